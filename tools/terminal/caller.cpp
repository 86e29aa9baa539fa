#include "tools/terminal/caller.h"

#include <csignal>
#include <iostream>
#include <memory>
#include <string>
#include <utility>

#include "tools/scene/scene_fields.h"
#include "tools/terminal/interrupt.h"
#include "tools/terminal/progress.h"

namespace sinew::tools {
namespace {

/// One piece of work after the other.
class Works {
 public:
  void update(std::string_view work, int done, int total) {
    if (!progress_ || work != work_) {
      work_ = work;
      progress_ = std::make_unique<Progress>(work_, total);
    }
    progress_->update(done);
    if (done == total) progress_.reset();
  }

 private:
  std::string work_;
  std::unique_ptr<Progress> progress_;
};

std::string asked_by() {
  const int signal = interrupt_signal();
  return signal == 0 ? "" : signal == SIGINT ? "SIGINT" : "SIGTERM";
}

}  // namespace

Caller terminal_caller() {
  Caller caller = quiet_caller();
  caller.talk = [](const std::string& line) { std::cerr << with_flags(line) << '\n'; };
  return caller;
}

Caller quiet_caller() {
  Caller caller;
  caller.progress = [works = std::make_shared<Works>()](std::string_view work, int done, int total) {
    works->update(work, done, total);
  };
  caller.stop = asked_by;
  return caller;
}

}  // namespace sinew::tools
