#include <algorithm>
#include <array>

#include "fem/models/blended.h"
#include "fem/models/model.h"
#include "fem/models/skin.h"

namespace sinew::fem {
namespace {

constexpr bool kDynamic = true, kPlaced = false;

constexpr auto kModels = std::to_array<ModelInfo>({
    {"skin", "free-form deformation: lattice vertices skinned by the bones; no dynamics", kPlaced, make_skin},
    {"blended", "one prefactored linear system per region, blended by weights; the fast default", kDynamic,
     make_blended},
});

}  // namespace

std::span<const ModelInfo> models() { return kModels; }

const ModelInfo* find_model(std::string_view name) {
  const auto found = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const ModelInfo& model) { return model.name == name; });
  return found == kModels.end() ? nullptr : &*found;
}

}  // namespace sinew::fem
