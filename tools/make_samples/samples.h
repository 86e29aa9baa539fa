#pragma once

#include <string>

#include "assets/glb_writer.h"

/// The characters that come with Sinew. Each is made of nothing but the numbers in its own file.
namespace sinew::samples {

/// An arm of two bones, hanging down. Clips: "elbow" (bends to 120 degrees and holds), "twist" (turns the
/// forearm by 90 degrees and holds).
assets::GlbScene make_arm();

/// A kangaroo-like biped with a heavy belly, a thick tail and long ears. Clips: "hop", "look".
assets::GlbScene make_hopper();

/// A rag doll of several parts: patches, a skirt and a cape with open edges, rigid eyes, joints without
/// weight and a root outside the body. Clip: "dance".
assets::GlbScene make_patchwork();

}  // namespace sinew::samples
