#include <algorithm>
#include <array>

#include "fem/models/detail/blended.h"
#include "fem/models/detail/blended_stiffness.h"
#include "fem/models/detail/corotational.h"
#include "fem/models/detail/neo_hookean.h"
#include "fem/models/detail/skin.h"
#include "fem/models/detail/springs.h"
#include "fem/models/detail/stvk.h"
#include "fem/models/model.h"

namespace sinew::fem {
namespace {

constexpr bool kDynamic = true, kPlaced = false;
constexpr bool kLasting = true, kFresh = false;  // factors

constexpr auto kModels = std::to_array<ModelInfo>({
    {"skin", "free-form deformation: lattice vertices skinned by the bones; no dynamics", kPlaced, kFresh,
     make_skin},
    {"springs", "mass-spring on cell edges and diagonals, matched to E; Poisson's ratio is 1/4", kDynamic,
     kFresh, make_springs},
    {"blended", "one prefactored linear system per region, blended by weights; the fastest with dynamics",
     kDynamic, kLasting, make_blended},
    {"blended-stiffness", "one linear system, cells turned by the blended rotation of their bones", kDynamic,
     kLasting, make_blended_stiffness},
    {"corotational", "one linear system, cells turned by their own rotation", kDynamic, kLasting,
     make_corotational},
    {"stvk", "St. Venant-Kirchhoff: finite strain by full Newton; collapses when squeezed to 0.58", kDynamic,
     kFresh, make_stvk},
    {"neo-hookean", "neo-Hookean, safe under inversion, by full Newton: the reference of the others",
     kDynamic, kFresh, make_neo_hookean},
});

}  // namespace

std::span<const ModelInfo> models() { return kModels; }

const ModelInfo* find_model(std::string_view name) {
  const auto found = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const ModelInfo& model) { return model.name == name; });
  return found == kModels.end() ? nullptr : &*found;
}

}  // namespace sinew::fem
