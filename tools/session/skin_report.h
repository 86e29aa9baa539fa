#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fem/skin/skin_judge.h"
#include "tools/session/character.h"

/// What an eye would see of the moving skin, and what to do about it.
namespace sinew::tools {

/// The judge of a character's whole skin, in the order of whole_skin.h; `times` [s]: of the frames, any of
/// the clip, at least one. Nothing where the character has no height or no clip.
std::optional<fem::SkinJudge> make_skin_judge(const Character& character, const std::vector<double>& times);

/// Judges the frames of a run, and knows how long that takes.
class FrameJudge {
 public:
  FrameJudge(const Scene& scene, const Character& character, const FrameRange& frames);

  /// Whole skins as whole_skin.h has them. Nothing for a plain scene.
  std::optional<fem::SkinFrame> measure(const lattice::Points& flesh, const lattice::Points& plain,
                                        fem::FrameKind kind);
  double seconds() const { return seconds_; }

 private:
  std::optional<fem::SkinJudge> judge_;
  double seconds_ = 0.0;
};

/// The verdict on a run or a pose.
struct SkinFinding {
  fem::SkinVerdict verdict = fem::SkinVerdict::Fine;
  int frame = -1;  ///< the number of the worst frame.
  int torn_frames = 0;
  std::string place;  ///< by bone and part.
  /// One line for the user: where, what and the remedy; empty where the skin is fine.
  std::string line;
  /// One more where the skin's volume is a twentieth off both that at rest and that of plain skinning.
  std::string volume_line;
};

/// Four times the stiffest flesh that there is [Pa], as --young counts everywhere.
double much_stiffer(const Character& character);

/// `frames` in order and their numbers, as many.
SkinFinding find_fault(const Scene& scene, const Character& character, const fem::Body& body,
                       const std::vector<fem::SkinFrame>& frames, const std::vector<int>& numbers);
/// The same of the one pose at `time` [s].
SkinFinding find_fault(const Scene& scene, const Character& character, const fem::Body& body,
                       const fem::SkinFrame& pose, double time);

/// Tells the user what an eye would see: torn is a warning, rough a note, fine is nothing.
void tell(const SkinFinding& finding, const Talk& talk);

/// With --strict: throws NumericalError with the finding's line where the skin is torn.
void refuse_torn(const SkinFinding& finding);

}  // namespace sinew::tools
