#include "assets/atomic_output.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

class AtomicOutput : public testing::Test {
 protected:
  void SetUp() override {
    root_ = tests::temporary_path("atomic");
    fs::remove_all(root_);
    fs::create_directory(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  std::string at(const std::string& name) const { return (root_ / name).string(); }
  /// Every entry below the root, hidden ones too, as relative paths.
  std::set<std::string> entries() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(root_))
      names.insert(fs::relative(entry.path(), root_).string());
    return names;
  }
  static void put(const std::string& file, const std::string& text) { std::ofstream(file) << text; }
  static std::string get(const std::string& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  const std::vector<std::string> own_ = {"skin.pc2", "skin.json"};

 private:
  fs::path root_;
};

TEST_F(AtomicOutput, FilesAppearUnderTheirNameOnlyWithCommit) {
  OutputDirectory out(at("run"), Overwrite::Refuse, own_);
  put(out.file("skin.pc2"), "points");
  write_file(out.file("skin.json"), "words", Overwrite::Refuse);  // must not wait for the folder's own lock
  EXPECT_FALSE(fs::exists(at("run")));
  out.commit();
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.json", "run/skin.pc2"));
  EXPECT_EQ(get(at("run/skin.pc2")), "points");
}

TEST_F(AtomicOutput, AnExceptionInTheMiddleLeavesNothing) {
  try {
    OutputDirectory out(at("run"), Overwrite::Refuse, own_);
    put(out.file("skin.pc2"), "half");
    throw std::runtime_error("stop");
  } catch (const std::runtime_error&) {
  }
  EXPECT_THAT(entries(), IsEmpty());
}

TEST_F(AtomicOutput, AnExceptionWhileOverwritingLeavesTheEarlierRunAsItWas) {
  fs::create_directory(at("run"));
  put(at("run/skin.pc2"), "old");
  try {
    OutputDirectory out(at("run"), Overwrite::Replace, own_);
    put(out.file("skin.pc2"), "new");
    throw std::runtime_error("stop");
  } catch (const std::runtime_error&) {
  }
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.pc2"));
  EXPECT_EQ(get(at("run/skin.pc2")), "old");
}

TEST_F(AtomicOutput, AnotherRunNeedsOverwriteAndIsThenReplacedWhole) {
  fs::create_directory(at("run"));
  put(at("run/skin.pc2"), "old");
  put(at("run/skin.json"), "old");
  EXPECT_THAT([&] { OutputDirectory(at("run"), Overwrite::Refuse, own_); },
              ThrowsMessage<BusyError>(at("run") +
                                       ": is not empty, it holds 'skin.json' and 1 more; hint: `overwrite` "
                                       "replaces an earlier run"));
  OutputDirectory out(at("run"), Overwrite::Replace, own_);
  put(out.file("skin.pc2"), "new");
  EXPECT_EQ(get(at("run/skin.pc2")), "old");
  out.commit();
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.pc2"));  // no mixture of two runs
  EXPECT_EQ(get(at("run/skin.pc2")), "new");
}

TEST_F(AtomicOutput, AnEmptyFolderNeedsNoOverwrite) {
  fs::create_directory(at("run"));
  OutputDirectory out(at("run"), Overwrite::Refuse, own_);
  put(out.file("skin.pc2"), "x");
  out.commit();
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.pc2"));
}

TEST_F(AtomicOutput, WhatIsNotOursIsNeverRemovedEvenWithOverwrite) {
  fs::create_directory(at("run"));
  put(at("run/skin.pc2"), "old");
  put(at("run/thesis.txt"), "years of work");
  EXPECT_THAT([&] { OutputDirectory(at("run"), Overwrite::Replace, own_); },
              ThrowsMessage<BusyError>(AllOf(HasSubstr("'thesis.txt'"), HasSubstr("would be lost"))));
  EXPECT_EQ(get(at("run/thesis.txt")), "years of work");
}

TEST_F(AtomicOutput, ContentThatComesWhileWeWorkStopsTheCommit) {
  OutputDirectory out(at("run"), Overwrite::Refuse, own_);
  put(out.file("skin.pc2"), "x");
  fs::create_directory(at("run"));
  put(at("run/other"), "y");
  EXPECT_THROW(out.commit(), BusyError);
  EXPECT_EQ(get(at("run/other")), "y");
}

TEST_F(AtomicOutput, AFileInThePlaceOfTheFolderIsAnIoError) {
  put(at("run"), "text");
  EXPECT_THAT([&] { OutputDirectory(at("run"), Overwrite::Replace, own_); },
              ThrowsMessage<IoError>(at("run") + ": is a file, expected a folder or a new name"));
  EXPECT_EQ(get(at("run")), "text");
}

TEST_F(AtomicOutput, MissingParentsAreMadeAndGoAgainWhereNothingCameOfIt) {
  { const OutputDirectory out(at("no/such/run"), Overwrite::Refuse, own_); }
  EXPECT_THAT(entries(), IsEmpty());
  {
    OutputDirectory out(at("no/such/run"), Overwrite::Refuse, own_);
    out.write("skin.pc2", "x");
    out.commit();
  }
  EXPECT_EQ(get(at("no/such/run/skin.pc2")), "x");
  write_file(at("one/more/file"), "y", Overwrite::Refuse);
  EXPECT_EQ(get(at("one/more/file")), "y");
}

TEST_F(AtomicOutput, AParentThatIsAFileIsAnIoError) {
  put(at("file"), "text");
  EXPECT_THROW(OutputDirectory(at("file/run"), Overwrite::Refuse, own_), IoError);
  EXPECT_THROW(OutputDirectory(at("file/deep/run"), Overwrite::Refuse, own_), IoError);
  EXPECT_EQ(get(at("file")), "text");
}

TEST_F(AtomicOutput, ALinkLoopIsAnIoErrorWithTheSystemsWords) {
  fs::create_symlink("b", at("a"));
  fs::create_symlink("a", at("b"));
  EXPECT_THAT([&] { OutputDirectory(at("a"), Overwrite::Refuse, own_); },
              ThrowsMessage<IoError>(HasSubstr("Too many levels of symbolic links")));
}

TEST_F(AtomicOutput, ASlashAtTheEndAndOddNamesAreTheSameFolder) {
  for (const std::string name :
       {"run/", "r\xc3\xbcn \xf0\x9f\xa6\x98", "-run", "line\nbreak", "not utf8 \xff"}) {
    OutputDirectory out(at(name), Overwrite::Refuse, own_);
    put(out.file("skin.pc2"), "x");
    out.commit();
    EXPECT_TRUE(fs::exists(at(name) + "/skin.pc2"));
  }
}

TEST_F(AtomicOutput, WhatAKilledProcessLeftIsRemovedByTheNext) {
  const pid_t child = ::fork();
  if (child == 0) {
    OutputDirectory out(at("run"), Overwrite::Refuse, own_);
    put(out.file("skin.pc2"), "half");
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const std::string left = ".run.partial-" + std::to_string(child);
  ASSERT_THAT(entries(), ElementsAre(left, left + "/.writing", left + "/skin.pc2"));
  {
    const OutputDirectory out(at("run"), Overwrite::Refuse, own_);
    const std::string own = ".run.partial-" + std::to_string(::getpid());
    EXPECT_THAT(entries(), ElementsAre(own, own + "/.writing"));
  }
  EXPECT_THAT(entries(), IsEmpty());
}

TEST_F(AtomicOutput, AWriterKilledAtAnyMomentNeverLeavesAMixture) {
  // A child overwrites the same folder again and again, each time with files that must agree; it is killed
  // after a time that differs from round to round. What stands under the final name is whole every time.
  std::mt19937_64 rng(20021);
  int rounds_with_output = 0;
  for (int round = 0; round < 40; ++round) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (int run = 0;; ++run) {
        OutputDirectory out(at("run"), Overwrite::Replace, own_);
        const std::string content =
            std::to_string(round) + "/" + std::to_string(run) + std::string(5000, '.');
        for (const std::string& name : own_) put(out.file(name), content);
        out.commit();
      }
    }
    ::usleep(static_cast<useconds_t>(rng() % 80000));
    ::kill(child, SIGKILL);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    if (!fs::exists(at("run"))) continue;
    ++rounds_with_output;
    ASSERT_EQ(get(at("run/skin.pc2")), get(at("run/skin.json")));
    ASSERT_GE(get(at("run/skin.pc2")).size(), 5000u);
  }
  EXPECT_GT(rounds_with_output, 0);
  { OutputDirectory(at("run"), Overwrite::Replace, own_); }
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.json", "run/skin.pc2"));
}

TEST_F(AtomicOutput, AnEarlierRunThatWasMovedAsideComesBack) {
  // What a process leaves that is killed between the two renames of a file system that cannot swap.
  const std::string partial = ".run.partial-1";
  fs::create_directory(at(partial));
  fs::create_directory(at(partial + "-replaced"));
  put(at(partial + "-replaced/skin.pc2"), "old");
  { OutputDirectory(at("other"), Overwrite::Refuse, own_); }  // not its business
  EXPECT_TRUE(fs::exists(at(partial)));
  { OutputDirectory(at("run"), Overwrite::Replace, own_); }
  EXPECT_THAT(entries(), ElementsAre("run", "run/skin.pc2"));
}

TEST_F(AtomicOutput, TwoProcessesCannotWriteTheSameOutput) {
  const OutputDirectory first(at("run"), Overwrite::Refuse, own_);
  const pid_t child = ::fork();
  if (child == 0) {
    int code = 1;
    try {
      const OutputDirectory second(at("run"), Overwrite::Refuse, own_);
    } catch (const BusyError& error) {
      code = std::string(error.what()).find("process " + std::to_string(::getppid()) + " is writing it") !=
                     std::string::npos
                 ? 42
                 : 2;
    } catch (...) {
      code = 3;
    }
    ::_exit(code);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 42);
  EXPECT_TRUE(fs::exists(at(".run.partial-" + std::to_string(::getpid()))));
}

TEST_F(AtomicOutput, AFullDiskNamesTheFileAndLeavesTheEarlierOne) {
  // The file size limit stands in for a full disk: write() fails after 64 bytes.
  put(at("a.vtu"), "old");
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit limit{64, 64};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ::signal(SIGXFSZ, SIG_IGN);
    int code = 1;
    try {
      write_file(at("a.vtu"), std::string(1000, 'x'), Overwrite::Replace);
    } catch (const IoError& error) {
      const std::string what = error.what();
      code = what.find(at("a.vtu")) == 0 && what.find("File too large") != std::string::npos ? 42 : 2;
    }
    ::_exit(code);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 42);
  EXPECT_THAT(entries(), ElementsAre("a.vtu"));
  EXPECT_EQ(get(at("a.vtu")), "old");
}

TEST_F(AtomicOutput, SingleFilesFollowTheSameRules) {
  write_file(at("a.vtu"), "one", Overwrite::Refuse);
  EXPECT_EQ(get(at("a.vtu")), "one");
  EXPECT_THAT([&] { write_file(at("a.vtu"), "two", Overwrite::Refuse); },
              ThrowsMessage<BusyError>(at("a.vtu") + ": exists already; hint: `overwrite` replaces it"));
  write_file(at("a.vtu"), "two", Overwrite::Replace);
  EXPECT_EQ(get(at("a.vtu")), "two");
  EXPECT_THAT(entries(), ElementsAre("a.vtu"));
  fs::create_directory(at("folder"));
  EXPECT_THROW(write_file(at("folder"), "x", Overwrite::Replace), IoError);
  EXPECT_THROW(write_file(at("a.vtu/b.vtu"), "x", Overwrite::Refuse), IoError);
}

}  // namespace
}  // namespace sinew::assets
