#pragma once

#include <optional>
#include <vector>

#include "fem/skin_guard.h"
#include "tools/character.h"

/// Mends the flesh of whole characters (fem/skin_guard.h).
namespace sinew::tools {

/// Does nothing where the scene has switched the guard off or is a plain one.
class FrameGuard {
 public:
  /// The character must outlive it.
  FrameGuard(const Scene& scene, const Character& character);

  /// Both by rig vertex, num_vertices x 3 [m]; changes flesh in `simulated` alone. Vertices of the result are
  /// those of the welded skin.
  fem::Mended mend(const lattice::Points& skinned, lattice::Points& simulated) const;

 private:
  const assets::PhysicsSkin* skin_ = nullptr;
  std::optional<fem::SkinGuard> guard_;
};

}  // namespace sinew::tools
