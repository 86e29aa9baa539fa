// Two frames of a rig through the installed package.
#include <cstdio>

#include "tools/session/session.h"

namespace {

class Print final : public sinew::tools::FrameSink {
 public:
  void take(const sinew::tools::Frame& frame) override {
    std::printf("frame %d: %d vertices, %s\n", frame.report.frame, static_cast<int>(frame.positions.rows()),
                frame.positions.allFinite() && frame.positions != frame.skinned ? "moved" : "as skinned");
  }
};

}  // namespace

int main(int, char** argv) {
  sinew::tools::Scene scene;
  scene.rig = argv[1];
  scene.frames = sinew::tools::FrameRange{0, 1};
  scene.cells = 150;
  sinew::tools::Session session(scene);
  Print print;
  sinew::tools::FrameSink* sinks[] = {&print};
  const sinew::tools::RunReport report = session.run(sinks);
  std::printf("%zu frames\n", report.frames.size());
}
