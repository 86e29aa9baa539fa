// Where the sag of the bar of ../shared/reference goes as its cells shrink. A minute on one core.
#include <gtest/gtest.h>

#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

double sag(const Eigen::Vector3i& blocks, int levels) {
  tests::BarOptions options;
  options.box.blocks = blocks;
  options.levels = levels;
  return tests::tip_sag(tests::bar_body(options));
}

// 20, 40 and 80 cells along the bar, 0.98, 0.35 and 0.11 % short of -3.766 m. The edges of the clamped face
// are singular, so the errors fall by a factor that is not four but steady: Aitken's limit lies in the band
// of
// +-0.002 m that CalculiX and a Ritz code leave (measured -3.7672 m).
TEST(ReferenceBar, SagsInTheLimitAsIndependentCodesSay) {
  const double coarse = sag({5, 1, 1}, 2), middle = sag({5, 1, 1}, 3), fine = sag({10, 2, 2}, 3);
  const double ratio = (fine - middle) / (middle - coarse);
  EXPECT_GT(ratio, 0.25);
  EXPECT_LT(ratio, 0.5);
  EXPECT_NEAR(fine, -3.766, 0.002 * 3.766);
  EXPECT_NEAR(fine + (fine - middle) * ratio / (1.0 - ratio), -3.766, 0.002);
}

}  // namespace
}  // namespace sinew::fem
