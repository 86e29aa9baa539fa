// Verdicts on the skins of many rigs, which may only get better: verdicts.txt beside this file, and of every
// rig verdicts_nightly.txt. A run that has become better says so; lower its row then.

#include <cctype>
#include <iomanip>
#include <iostream>
#include <map>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

/// A row of the table.
struct Row {
  std::string rig, clip, frames, verdict;
};

/// The rows of the samples, or of ../shared.
std::vector<Row> rows() {
  std::ifstream stream(fs::path(SINEW_SOURCE_DIR) / "tests/tools" / SINEW_VERDICTS);
  std::vector<Row> rows;
  for (std::string line; std::getline(stream, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    Row row;
    words >> row.rig >> std::quoted(row.clip) >> row.frames >> row.verdict;
    const bool shared = row.rig.find('/') != std::string::npos;
    if (shared == (SINEW_SHARED_RIGS == 1)) rows.push_back(row);
  }
  return rows;
}

class Verdicts : public ::testing::TestWithParam<Row> {};

TEST_P(Verdicts, AreNoWorseThanTheyWere) {
  const Row& row = GetParam();
  const std::map<std::string, int> rank{{"fine", 0}, {"rough", 1}, {"torn", 2}};
  ASSERT_TRUE(rank.contains(row.verdict)) << row.rig << ": verdict '" << row.verdict << "'";
  const fs::path rig = SINEW_SHARED_RIGS == 1 ? fs::path(SINEW_SHARED_DIR) / "data/public" / row.rig
                                              : fs::path(SINEW_SOURCE_DIR) / "assets/samples" / row.rig;
  ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
  const fs::path out = fs::path(SINEW_BINARY_DIR) / "verdicts_test" / (rig.filename().string() + row.clip);
  fs::remove_all(out);
  fs::create_directories(out.parent_path());
  const std::string clip = row.clip == "-" ? "" : " --clip " + tests::quoted(row.clip);
  const Outcome outcome = run(command_line("simulate " + quoted(rig) + clip + " --frames " + row.frames +
                                           " --preview off --cache off -o " + quoted(out)));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const nlohmann::json skin = nlohmann::json::parse(read(out / "report.json"))["skin"];
  fs::remove_all(out);
  const auto verdict = skin["verdict"].get<std::string>();
  EXPECT_LE(rank.at(verdict), rank.at(row.verdict)) << skin.dump(1);
  if (rank.at(verdict) < rank.at(row.verdict))
    std::cout << row.rig << ", " << row.clip << ": " << verdict << " now, better than the table has it\n";
}

INSTANTIATE_TEST_SUITE_P(All, Verdicts, ::testing::ValuesIn(rows()), [](const auto& row) {
  std::string name = row.param.rig + "_" + row.param.clip;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
});

}  // namespace
}  // namespace sinew::tests
