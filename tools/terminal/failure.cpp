#include "tools/terminal/failure.h"

#include <filesystem>
#include <ios>
#include <new>
#include <system_error>

#include <CLI/Error.hpp>
#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene/scene_fields.h"
#include "tools/support/errors.h"
#include "tools/support/text.h"
#include "tools/terminal/exit_code.h"
#include "tools/terminal/interrupt.h"

namespace sinew::tools {
Failure describe_failure(const std::exception_ptr& error) {
  const auto failure = [](int code, const std::exception& e) {
    return Failure{code, single_line(with_flags(e.what()))};
  };
  // From the special to the general: several of these are runtime_error.
  try {
    std::rethrow_exception(error);
  } catch (const Stopped& e) {
    return failure(exit_code::kSignalBase + interrupt_signal(), e);
  } catch (const assets::ConfigError& e) {
    return failure(exit_code::kUsage, e);
  } catch (const CLI::Error& e) {
    return failure(exit_code::kUsage, e);
  } catch (const assets::InputError& e) {
    return failure(exit_code::kInput, e);
  } catch (const NumericalError& e) {
    return failure(exit_code::kNumerical, e);
  } catch (const assets::IoError& e) {
    return failure(exit_code::kIo, e);
  } catch (const assets::LimitError& e) {
    return failure(exit_code::kLimit, e);
  } catch (const assets::BusyError& e) {
    return failure(exit_code::kBusy, e);
  } catch (const std::system_error& e) {  // filesystem_error and ios_base::failure among them
    return failure(exit_code::kIo, e);
  } catch (const std::bad_alloc&) {
    return {exit_code::kLimit, "out of memory; hint: fewer --cells or --levels"};
  } catch (const std::exception& e) {
    return {exit_code::kInternalError, single_line(fmt::format("internal error: {} (a bug)", e.what()))};
  } catch (...) {
    return {exit_code::kInternalError, "internal error: something was thrown that is no exception (a bug)"};
  }
}

}  // namespace sinew::tools
