#pragma once

#include "tools/support/caller.h"

namespace sinew::tools {

/// The user at a terminal: words and progress go to stderr, SIGINT and SIGTERM stop the work.
Caller terminal_caller();

/// The same without words.
Caller quiet_caller();

}  // namespace sinew::tools
