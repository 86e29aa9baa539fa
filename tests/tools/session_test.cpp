// A run as programs of others start it: no files, no terminal.
#include "tools/session/session.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "tools/support/errors.h"

namespace sinew::tools {
namespace {

using testing::HasSubstr;

Scene arm() {
  Scene scene;
  scene.rig = SINEW_SOURCE_DIR "/assets/samples/arm.glb";
  scene.cells = 150;
  scene.frames = FrameRange{3, 7};
  return scene;
}

/// Keeps what it is given.
class Keeper final : public FrameSink {
 public:
  void take(const Frame& frame) override {
    EXPECT_FALSE(finished);
    EXPECT_EQ(frame.positions.rows(), frame.skinned.rows());
    EXPECT_TRUE(frame.positions.allFinite());
    numbers.push_back(frame.report.frame);
    positions.push_back(frame.positions);
  }
  void finish() override { finished = true; }

  std::vector<int> numbers;
  std::vector<lattice::Points> positions;
  bool finished = false;
};

TEST(Session, GivesEveryFrameToEverySinkInOrder) {
  Session session(arm());
  Keeper first, second;
  std::vector<FrameSink*> sinks{&first, &second};
  const RunReport report = session.run(sinks);
  EXPECT_EQ(first.numbers, (std::vector<int>{3, 4, 5, 6, 7}));
  EXPECT_TRUE(first.finished && second.finished);
  EXPECT_EQ(first.positions, second.positions);
  EXPECT_EQ(report.frames.size(), 5u);
  EXPECT_TRUE(report.finding);
  EXPECT_THROW(session.run(sinks), std::logic_error) << "a second time";
}

TEST(Session, TellsItsCallerAndReportsProgress) {
  std::vector<std::string> lines;
  std::vector<int> done;
  Caller caller;
  caller.talk = [&](const std::string& line) { lines.push_back(line); };
  caller.progress = [&](std::string_view work, int part, int all) {
    EXPECT_EQ(work, "simulating");
    EXPECT_EQ(all, 5);
    done.push_back(part);
  };
  Session session(arm(), caller);
  session.run({});
  EXPECT_THAT(lines, testing::Contains(HasSubstr("frames 3 to 7 at 30 fps")));
  EXPECT_THAT(lines, testing::Contains(HasSubstr("frame 3: at most")));
  EXPECT_EQ(done, (std::vector<int>{1, 2, 3, 4, 5}));
}

TEST(Session, StopsWhenItsCallerWantsToAndSaysWhere) {
  int asked = 0, most = 1000000;
  Caller caller;
  caller.stop = [&] { return ++asked > most ? "the end of the day" : ""; };
  {
    Session session(arm(), caller);
    session.run({});
  }
  // Asked often enough to stop anywhere, the last time not long before the end.
  const int all = asked;
  EXPECT_GT(all, 20);
  for (const int after : {0, all / 2, all - 2}) {
    most = after;
    asked = 0;
    Keeper keeper;
    FrameSink* sink = &keeper;
    try {
      Session session(arm(), caller);
      session.run({&sink, 1});
      FAIL() << "went on after " << after;
    } catch (const Stopped& e) {
      EXPECT_THAT(e.what(), HasSubstr("stopped by the end of the day "));
    }
    EXPECT_FALSE(keeper.finished);
  }
}

TEST(Session, ChecksItsScene) {
  Scene scene = arm();
  scene.poisson = 0.7;
  try {
    Session session(scene);
    FAIL() << "took a Poisson's ratio of 0.7";
  } catch (const assets::ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("poisson: got 0.7"));
  }
  scene = arm();
  scene.model = "blended";
  scene.integrator = fem::Integrator::TrBdf2;
  Session session(scene);
  EXPECT_THROW(session.run({}), assets::ConfigError) << "what a model and an integrator cannot do together";
}

}  // namespace
}  // namespace sinew::tools
