#include "tools/interrupt.h"

#include <atomic>

#include <signal.h>

#include "tools/failure.h"

namespace sinew::tools {
namespace {

// The only global of the command: a signal handler can reach nothing else.
std::atomic<int> received_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may touch only lock-free atomics");

extern "C" void remember_signal(int signal) { received_signal.store(signal, std::memory_order_relaxed); }

}  // namespace

void install_interrupt_handlers() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  sigemptyset(&action.sa_mask);
  // SA_RESETHAND: the second signal of a kind finds the default action again. SA_RESTART: no read or write of
  // ours fails with EINTR for the sake of a flag.
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

int interrupt_signal() { return received_signal.load(std::memory_order_relaxed); }

void stop_if_interrupted(const std::string& where) {
  const int signal = interrupt_signal();
  if (signal == 0) return;
  const std::string name = signal == SIGINT ? "SIGINT" : "SIGTERM";
  throw Interrupted(signal, "stopped by " + name + (where.empty() ? "" : " " + where));
}

}  // namespace sinew::tools
