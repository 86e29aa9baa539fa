#pragma once

#include <memory>

#include "fem/skin/skin_guard.h"
#include "fem/skin/steady_guard.h"
#include "tools/session/character.h"

/// Mends the flesh of whole characters (fem/skin/skin_guard.h).
namespace sinew::tools {

/// Does nothing where the scene has switched the guard off or is a plain one. For an instant that stands
/// alone, or for frames in a row (fem/skin/steady_guard.h).
class FrameGuard {
 public:
  /// The character must outlive it; `fps`: of the frames [Hz]; 0: no frames in a row.
  FrameGuard(const Scene& scene, const Character& character, double fps = 0.0);

  /// How many frames must be seen after one before it can be mended, unless none will follow.
  int lookahead() const { return steady_ ? steady_->lookahead() : 0; }
  /// The next frame as the flesh has it. Both by rig vertex, num_vertices x 3 [m].
  void see(const lattice::Points& skinned, const lattice::Points& simulated);
  /// The first frame that was seen and not mended; changes flesh in `simulated`, of that frame, alone.
  /// Vertices of the result are those of the welded skin.
  fem::Mended mend_next(lattice::Points& simulated);

  /// An instant that stands alone.
  fem::Mended mend(const lattice::Points& skinned, lattice::Points& simulated) const;

 private:
  const assets::PhysicsSkin* skin_;
  std::unique_ptr<const fem::SkinGuard> guard_;
  std::unique_ptr<fem::SteadyGuard> steady_;  ///< of *guard_.
};

}  // namespace sinew::tools
