#include "tools/interrupt.h"

#include <atomic>

#include <pthread.h>
#include <signal.h>

#include "tools/failure.h"

namespace sinew::tools {
namespace {

// The only global of the command: a signal handler can reach nothing else.
std::atomic<int> received_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may touch only lock-free atomics");

sigset_t terminate_set() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  return set;
}

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
  // SIGTERM is blocked, here and so in every thread to come, and fetched when somebody asks: while METIS
  // orders a matrix it puts a handler of its own in our place, which jumps back into METIS and crashes any
  // other thread.
  const sigset_t terminate = terminate_set();
  pthread_sigmask(SIG_BLOCK, &terminate, nullptr);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

int interrupt_signal() {
  const int known = received_signal.load(std::memory_order_relaxed);
  if (known != 0) return known;
  const sigset_t terminate = terminate_set();
  const timespec at_once{0, 0};
  if (sigtimedwait(&terminate, nullptr, &at_once) == SIGTERM) remember_signal(SIGTERM);
  return received_signal.load(std::memory_order_relaxed);
}

void stop_if_interrupted(const std::string& where) {
  const int signal = interrupt_signal();
  if (signal == 0) return;
  const std::string name = signal == SIGINT ? "SIGINT" : "SIGTERM";
  throw Interrupted(signal, "stopped by " + name + (where.empty() ? "" : " " + where));
}

}  // namespace sinew::tools
