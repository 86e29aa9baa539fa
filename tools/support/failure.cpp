#include "tools/support/failure.h"

#include <filesystem>
#include <ios>
#include <new>
#include <system_error>

#include <CLI/Error.hpp>
#include <fmt/format.h>

#include "assets/error.h"
#include "tools/support/exit_code.h"

namespace sinew::tools {
namespace {

/// Length of the UTF-8 sequence that starts at `i`, 0 where there is none. Overlong forms, surrogates and
/// values above U+10FFFF are refused.
std::size_t utf8_length(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = byte(i);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || i + length > text.size()) return 0;
  for (std::size_t k = i + 1; k < i + length; ++k) {
    if ((byte(k) & 0xC0) != 0x80) return 0;
  }
  const unsigned char second = byte(i + 1);
  const bool overlong = (lead == 0xE0 && second < 0xA0) || (lead == 0xF0 && second < 0x90);
  const bool outside = (lead == 0xED && second > 0x9F) || (lead == 0xF4 && second > 0x8F);
  return overlong || outside ? 0 : length;
}

}  // namespace

bool is_utf8(const std::string& text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) return false;
    i += length;
  }
  return true;
}

std::string single_line(const std::string& text) {
  std::string line;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    const auto byte = static_cast<unsigned char>(text[i]);
    if (length == 0 || byte < 0x20 || byte == 0x7F) {
      line += fmt::format("\\x{:02x}", byte);
      ++i;
    } else {
      line.append(text, i, length);
      i += length;
    }
  }
  return line;
}

Failure describe_failure(const std::exception_ptr& error) {
  const auto failure = [](int code, const std::exception& e) { return Failure{code, single_line(e.what())}; };
  // From the special to the general: several of these are runtime_error.
  try {
    std::rethrow_exception(error);
  } catch (const Interrupted& e) {
    return failure(exit_code::kSignalBase + e.signal(), e);
  } catch (const assets::ConfigError& e) {
    return failure(exit_code::kUsage, e);
  } catch (const CLI::Error& e) {
    return failure(exit_code::kUsage, e);
  } catch (const std::invalid_argument& e) {
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
