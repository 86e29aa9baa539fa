#pragma once

/// Stopping on request: SIGINT and SIGTERM set a flag that long work polls.
namespace sinew::tools {

/// From now on the first SIGINT only sets the flag; the second ends the process at once (its default action),
/// as a user who insists expects. SIGTERM waits until interrupt_signal fetches it. To be called before any
/// thread is started. SIGPIPE and SIGXFSZ are ignored: a write that
/// fails says so.
void install_interrupt_handlers();

/// The signal that asked to stop, or 0. Cheap; for any thread.
int interrupt_signal();

}  // namespace sinew::tools
