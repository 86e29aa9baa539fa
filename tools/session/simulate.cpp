#include "tools/session/simulate.h"

#include <chrono>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "assets/atomic_output.h"
#include "assets/lattice_cache.h"
#include "tools/session/run_output.h"
#include "tools/session/session.h"

namespace sinew::tools {
namespace {

/// Everything that a run may write into its folder.
const std::vector<std::string> kOutputs{kRestFile,    kCacheFile,  kSidecarFile,
                                        kLatticeFile, kReportFile, kPictureFile};

}  // namespace

std::string simulate(const Scene& scene, const Caller& caller) {
  const assets::Overwrite overwrite =
      scene.overwrite ? assets::Overwrite::Replace : assets::Overwrite::Refuse;
  assets::OutputDirectory out(scene.output, overwrite, kOutputs);
  Session session(scene, caller);
  const Character& character = session.character();
  const FrameRange frames = session.frames();
  const int count = frames.last - frames.first + 1;
  const OutputLayout layout = make_layout(scene, character);
  CacheSink cache(layout, character, out.file(kCacheFile), frames.first);
  std::optional<PreviewSink> preview;
  std::vector<FrameSink*> sinks{&cache};
  if (scene.preview == Switch::On) sinks.push_back(&preview.emplace(character, count));

  RunReport report = session.run(sinks);
  const auto start = std::chrono::steady_clock::now();
  if (preview) preview->write(out.file(kPictureFile));
  report.times.emplace_back("preview",
                            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  write_companions(scene, character, layout, report, session.body(), frames, out);
  caller.stop_if_asked("before the results were in place");
  out.commit();
  if (!character.new_lattice_key.empty())
    assets::keep_lattice(assets::cache_folder(scene.output), character.new_lattice_key, character.lattice,
                         character.input.joints);

  const Talk talk = caller.words();
  double total = 0.0;
  for (const auto& phase : report.times) total += phase.second;
  talk(fmt::format("wrote {} frames of {} vertices to {} in {:.1f} s:", count, layout.rig_vertex.size(),
                   scene.output, total));
  for (const std::string& name : kOutputs) {
    if (name != kPictureFile || preview) talk("  " + scene.output + "/" + name);
  }
  if (preview) talk("look at " + scene.output + "/" + kPictureFile);
  if (report.finding) tell(*report.finding, talk);
  return report_json(report, character, session.body());
}

}  // namespace sinew::tools
