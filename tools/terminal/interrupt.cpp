#include "tools/terminal/interrupt.h"

#include <atomic>
#include <mutex>
#include <thread>

#include <pthread.h>
#include <signal.h>

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

/// The first SIGTERM is remembered; one after any other signal ends the program at once, as it would have
/// done without us.
void watch_for_terminate() {
  const sigset_t terminate = terminate_set();
  int signal = 0;
  while (sigwait(&terminate, &signal) == 0) {
    if (received_signal.exchange(signal) == 0) continue;
    struct sigaction action {};
    action.sa_handler = SIG_DFL;
    sigaction(SIGTERM, &action, nullptr);
    pthread_sigmask(SIG_UNBLOCK, &terminate, nullptr);
    raise(SIGTERM);
  }
}

}  // namespace

void install_interrupt_handlers() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  sigemptyset(&action.sa_mask);
  // SA_RESETHAND: the second signal of a kind finds the default action again. SA_RESTART: no read or write of
  // ours fails with EINTR for the sake of a flag.
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  // SIGTERM is blocked, here and so in every thread to come, and fetched by one that waits for it: while
  // METIS orders a matrix it puts a handler of its own in our place, which jumps back into METIS and crashes
  // any other thread.
  const sigset_t terminate = terminate_set();
  pthread_sigmask(SIG_BLOCK, &terminate, nullptr);
  static std::once_flag watching;
  std::call_once(watching, [] { std::thread(watch_for_terminate).detach(); });
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

int interrupt_signal() {
  // A signal sent to this thread alone is not seen by the one that waits.
  const sigset_t terminate = terminate_set();
  const timespec at_once{0, 0};
  if (received_signal.load() == 0 && sigtimedwait(&terminate, nullptr, &at_once) == SIGTERM)
    remember_signal(SIGTERM);
  return received_signal.load();
}

}  // namespace sinew::tools
