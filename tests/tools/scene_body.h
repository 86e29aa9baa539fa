#pragma once

#include <memory>
#include <string>

#include "fem/time/equilibrium.h"
#include "tools/scene/scene.h"
#include "tools/session/character.h"
#include "tools/session/plain_loads.h"

/// The body of a scene of tests/scenes, for what no command asks of it.
namespace sinew::tests {

struct SceneBody {
  tools::Scene scene;
  tools::Character character;
  fem::Body body;

  explicit SceneBody(const std::string& name)
      : scene(tools::read_scene(std::string(SINEW_SOURCE_DIR) + "/tests/scenes/" + name + ".toml")),
        character(make()),
        body(tools::make_body(character)) {}

  fem::Motion motion() const {
    return [this](double time) { return character.pose(time); };
  }
  /// Poses from time 0 to `end` [s].
  fem::PosePath path(double end = 1.0) const {
    return [this, end](double factor) { return character.pose(factor * end); };
  }
  fem::EquilibriumOptions rest_options(const std::string& model) const {
    fem::EquilibriumOptions options;
    options.model = model;
    options.gravity = scene.gravity;
    options.loads = tools::loads_of(*scene.plain);
    return options;
  }

 private:
  tools::Character make() const {
    scene.validate();
    return tools::make_character(scene, {});
  }
};

}  // namespace sinew::tests
