#include "tools/support/caller.h"

#include "tools/support/errors.h"

namespace sinew::tools {

Talk Caller::words() const {
  return talk ? talk : [](const std::string&) {};
}

void Caller::report(std::string_view work, int done, int total) const {
  if (progress) progress(work, done, total);
}

bool Caller::wants_to_stop() const { return stop && !stop().empty(); }

void Caller::stop_if_asked(const std::string& where) const {
  const std::string why = stop ? stop() : std::string();
  if (!why.empty()) throw Stopped("stopped by " + why + (where.empty() ? "" : " " + where));
}

}  // namespace sinew::tools
