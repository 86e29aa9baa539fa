// The front of the command: exit codes, one line per failure, suggestions, signals. The binary itself is run
// where the shell's view matters.

#include "tools/shell/run.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <string>
#include <system_error>

#include <unistd.h>

#include <gtest/gtest.h>

#include "assets/error.h"
#include "tests/tools/run_command.h"
#include "tools/support/errors.h"
#include "tools/support/suggest.h"
#include "tools/support/text.h"
#include "tools/terminal/caller.h"
#include "tools/terminal/exit_code.h"
#include "tools/terminal/failure.h"
#include "tools/terminal/interrupt.h"
#include "tools/terminal/progress.h"

namespace sinew::tools {
namespace {

using tests::Outcome;

/// Runs `sinew` with arguments and redirections for the shell.
Outcome run_sinew(const std::string& arguments) {
  return tests::run_line(std::string("'") + SINEW_COMMAND + "' " + arguments);
}

template <class Error>
Failure failure_of(const Error& error) {
  return describe_failure(std::make_exception_ptr(error));
}

TEST(Failure, MapsEveryKindOfErrorToItsExitCode) {
  EXPECT_EQ(failure_of(assets::ConfigError("c")).exit_code, 2);
  EXPECT_EQ(failure_of(assets::InputError("a.glb", "no skin")).exit_code, 3);
  EXPECT_EQ(failure_of(NumericalError("step 3")).exit_code, 4);
  EXPECT_EQ(failure_of(assets::IoError("i")).exit_code, 5);
  EXPECT_EQ(
      failure_of(std::filesystem::filesystem_error("f", std::make_error_code(std::errc::io_error))).exit_code,
      5);
  EXPECT_EQ(failure_of(assets::LimitError("l")).exit_code, 6);
  EXPECT_EQ(failure_of(std::bad_alloc()).exit_code, 6);
  EXPECT_EQ(failure_of(assets::BusyError("b")).exit_code, 7);
  EXPECT_EQ(failure_of(Stopped("stopped")).exit_code, 128);  // and the number of the signal that came
  EXPECT_EQ(failure_of(std::invalid_argument("dt: got 0")).exit_code, 1) << "a bug of ours";
  EXPECT_EQ(failure_of(std::runtime_error("r")).exit_code, 1);
  EXPECT_EQ(failure_of(std::logic_error("r")).exit_code, 1);
  EXPECT_EQ(failure_of(42).exit_code, 1);
}

TEST(Failure, KeepsTheMessageAndCallsTheUnforeseenABug) {
  EXPECT_EQ(failure_of(assets::InputError("a.glb", "no skin")).message, "a.glb: no skin");
  EXPECT_EQ(failure_of(std::runtime_error("r")).message, "internal error: r (a bug)");
  EXPECT_EQ(failure_of(42).message, "internal error: something was thrown that is no exception (a bug)");
}

TEST(Failure, PutsControlCharactersAndBrokenUtf8OnOneReadableLine) {
  EXPECT_EQ(single_line("a\nb\tc\x1b[31m\x7f"), "a\\x0ab\\x09c\\x1b[31m\\x7f");
  EXPECT_EQ(single_line("Füße 骨 🦘"), "Füße 骨 🦘");
  EXPECT_EQ(single_line("\xFF\xC3"), "\\xff\\xc3");
  EXPECT_EQ(single_line("\xC0\xAF"), "\\xc0\\xaf") << "overlong";
  EXPECT_EQ(single_line("\xED\xA0\x80"), "\\xed\\xa0\\x80") << "surrogate";
  EXPECT_EQ(single_line("\xF4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "above U+10FFFF";
}

TEST(Suggestion, CountsEditsAndSwaps) {
  EXPECT_EQ(edit_distance("", "abc"), 3);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3);
  EXPECT_EQ(edit_distance("dampnig", "damping"), 1);
  EXPECT_EQ(edit_distance("ab", "ba"), 1);
  EXPECT_EQ(edit_distance("same", "same"), 0);
}

TEST(Suggestion, IsEmptyWhereNothingIsNear) {
  EXPECT_EQ(nearest("--yuong", {"--density", "--young"}), "--young");
  EXPECT_EQ(nearest("--cel", {"--help", "--cell-size", "--cells"}), "--cells") << "a beginning";
  EXPECT_EQ(nearest("--models", {"--mode", "--model"}), "--model");
  EXPECT_EQ(nearest("temperature", {"young", "density"}), "");
  EXPECT_EQ(nearest("xyz", {"abc", "de"}), "");
}

TEST(ProgressLine, TellsShareAndTimeLeft) {
  EXPECT_EQ(progress_line("hop", 0, 10, 3.0), "hop: 0 %");
  EXPECT_EQ(progress_line("hop", 4, 10, 40.0), "hop: 40 %, 1 min 0 s left");
  EXPECT_EQ(progress_line("hop", 1, 100, 100.0), "hop: 1 %, 2 h 45 min left");
  EXPECT_EQ(progress_line("hop", 10, 10, 3.0), "hop: 100 %");
  EXPECT_EQ(progress_line("nothing", 0, 0, 0.0), "nothing: 100 %");
}

/// What a command does between two steps.
[[noreturn]] void poll_and_exit() {
  try {
    quiet_caller().stop_if_asked("after frame 3");
  } catch (...) {
    const Failure failure = describe_failure(std::current_exception());
    std::fputs(failure.message.c_str(), stderr);
    std::_Exit(failure.exit_code);
  }
  std::_Exit(0);
}

// In processes of their own (death tests), as the flag belongs to the whole process.
TEST(InterruptDeathTest, StopsCleanlyAtTheFirstSignal) {
  EXPECT_EXIT((install_interrupt_handlers(), raise(SIGINT), poll_and_exit()), testing::ExitedWithCode(130),
              "^stopped by SIGINT after frame 3$");
  EXPECT_EXIT((install_interrupt_handlers(), raise(SIGTERM), poll_and_exit()), testing::ExitedWithCode(143),
              "^stopped by SIGTERM after frame 3$");
  EXPECT_EXIT((install_interrupt_handlers(), poll_and_exit()), testing::ExitedWithCode(0), "^$");
}

TEST(InterruptDeathTest, StopsAtOnceAtTheSecondSignal) {
  EXPECT_EXIT((install_interrupt_handlers(), raise(SIGINT), raise(SIGINT), poll_and_exit()),
              testing::KilledBySignal(SIGINT), "");
}

/// Sent to the process and not to a thread of it, as another program sends it; waits until it has been seen.
void send_and_wait(int signal) {
  kill(getpid(), signal);
  for (int n = 0; n < 5000 && interrupt_signal() == 0; ++n) usleep(1000);
}

TEST(InterruptDeathTest, StopsAtOnceAtTheSecondSigterm) {
  EXPECT_EXIT((install_interrupt_handlers(), send_and_wait(SIGTERM), kill(getpid(), SIGTERM), sleep(20),
               poll_and_exit()),
              testing::KilledBySignal(SIGTERM), "");
  EXPECT_EXIT((install_interrupt_handlers(), send_and_wait(SIGTERM), poll_and_exit()),
              testing::ExitedWithCode(143), "^stopped by SIGTERM after frame 3$");
}

TEST(Command, PrintsItsVersion) {
  const Outcome outcome = run_sinew("--version");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.text, "sinew " SINEW_VERSION "\n");
}

TEST(Command, PrintsHelpOnStdout) {
  const Outcome outcome = run_sinew("--help");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.text.find("Usage: sinew"), std::string::npos) << outcome.text;
}

TEST(Command, SuggestsTheNearestOption) {
  const Outcome outcome = run_sinew("--verzion 2>&1 >/dev/null");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.text, "sinew: --verzion: unknown option; hint: did you mean --version?\n");
}

TEST(Command, SuggestsTheNearestOptionOfTheSubcommandAndTheNearestSubcommand) {
  const Outcome option = run_sinew("inspect --jsno x 2>&1 >/dev/null");
  EXPECT_EQ(option.exit_code, 2);
  EXPECT_EQ(option.text, "sinew: --jsno: unknown option; hint: did you mean --json?\n");
  const Outcome far_off = run_sinew("inspect --temperature=3 x 2>&1 >/dev/null");
  EXPECT_EQ(far_off.exit_code, 2);
  EXPECT_EQ(far_off.text, "sinew: --temperature: unknown option; hint: see sinew inspect --help\n");
  const Outcome command = run_sinew("insect x 2>&1 >/dev/null");
  EXPECT_EQ(command.exit_code, 2);
  EXPECT_NE(command.text.find("sinew: insect: unknown command, expected one of compare, inspect,"),
            std::string::npos);
  EXPECT_NE(command.text.find("hint: did you mean inspect?\n"), std::string::npos) << command.text;
}

TEST(Command, SaysWhenACommandIsMissing) {
  const Outcome outcome = run_sinew("2>&1 >/dev/null");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.text.rfind("sinew: a command is missing, expected one of ", 0), 0u) << outcome.text;
}

TEST(Command, EndsQuietlyWhenTheReaderGoesAway) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);  // the reader has gone before anything is written
  const Outcome outcome = run_sinew("--help 2>&1 >&" + std::to_string(ends[1]));
  close(ends[1]);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.text, "");
}

// More than a pipe's buffer holds: the write that fails is not the last.
TEST(Command, EndsQuietlyWhenTheReaderOfALongAnswerGoesAway) {
  const std::string rig = SINEW_SOURCE_DIR "/assets/samples/hopper.glb";
  const std::string line = std::string("inspect '") + rig + "' --json 2>&1 >&";
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);
  const Outcome outcome = run_sinew(line + std::to_string(ends[1]));
  close(ends[1]);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.text, "");
}

TEST(Command, SaysWhenStandardOutputCannotBeWritten) {
  const Outcome full = run_sinew("--help 2>&1 >/dev/full");
  EXPECT_EQ(full.exit_code, 5);
  EXPECT_EQ(full.text, "sinew: standard output: cannot be written; hint: is the disk full?\n");
}

TEST(Command, KeepsItsExitCodeWhenNobodyCanReadTheMessage) {
  EXPECT_EQ(run_sinew("--verzion 2>/dev/full").exit_code, 2);
  EXPECT_EQ(run_sinew("--verzion 2>&-").exit_code, 2);
}

}  // namespace
}  // namespace sinew::tools
