// The program's readers of pairs files, camera files and cameras.yaml on the cases of test/formats,
// which test/python/test_formats.py runs for the tools' readers. Objects with destructors are used
// only inside functions that return plain values, since Unity leaves a failing test by longjmp,
// which skips destructors.

#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "files/camera_formats.h"
#include "files/camera_set.h"
#include "files/copies.h"
#include "files/mask_file.h"
#include "files/natural_order.h"
#include "files/pairs_file.h"

// unity.h comes after all other headers: it defines isnan and isinf as macros.
#include "unity.h"

using namespace cli;
using Json = nlohmann::ordered_json;

void setUp(void) {}
void tearDown(void) {}

namespace {

namespace fs = std::filesystem;
constexpr int kFewestCases = 20;

Json load(const char* name) {
  std::ifstream stream(std::string(TWOVIEW_FORMATS_DIR "/") + name);
  return Json::parse(stream);
}

// The case's lines, each ended by LF; a $NAME in them is replaced by its entry of `given`.
std::string text_of(const Json& file, const Json& test) {
  std::string text;
  for (const Json& line : test["text"]) text += line.get<std::string>() + "\n";
  if (!file.contains("given")) return text;
  for (const auto& [name, value] : file["given"].items())
    for (size_t at; (at = text.find("$" + name)) != std::string::npos;)
      text.replace(at, name.size() + 1, value.get<std::string>());
  return text;
}

// A rotation of a file is made one by iterations, whose last digits are not the format's.
Json rounded(std::array<double, 9> R) {
  for (double& value : R) value = std::round(value * 1e12) / 1e12;
  return R;
}

Json pair_json(const Pair& pair) {
  const Json null;
  return {{"name0", pair.name0},
          {"name1", pair.name1},
          {"turns", {pair.turns0, pair.turns1}},
          {"K0", pair.has_K ? Json(pair.K0) : null},
          {"K1", pair.has_K ? Json(pair.K1) : null},
          {"R", pair.has_truth ? rounded(pair.R) : null},
          {"t", pair.has_truth ? Json(pair.t) : null}};
}

Json camera_json(const tv_camera& camera) {
  const char* const models[] = {"pinhole", "brown_conrady", "kannala_brandt"};
  std::vector<double> k(camera.k, camera.k + 8);
  while (!k.empty() && k.back() == 0) k.pop_back();
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"model", models[camera.model]},
          {"k", k}};
}

Json pairs_json(const std::string& text) {
  Json pairs = Json::array();
  for (const Pair& pair : parse_pairs(text, "the file")) pairs.push_back(pair_json(pair));
  return pairs;
}

Json camera_set_json(const std::string& text) {
  Json cameras = Json::array();
  for (const auto& [name, camera] : parse_camera_set(text, "the file")) {
    Json entry = {{"name", name}};
    entry.update(camera_json(camera));
    cameras.push_back(entry);
  }
  return cameras;
}

Json camera_formats_json(const std::string& text) {
  Json cameras = Json::array();
  for (const auto& [name, camera] : parse_camera_file(text, "the file").cameras) {
    Json entry = {{"name", name}};
    entry.update(camera_json(camera));
    cameras.push_back(entry);
  }
  return cameras;
}

bool is_refused_as(const Json& test, const std::string& message) {
  bool fits = message.find("the file") != std::string::npos &&
              message.find('\n') == std::string::npos && test.contains("refused");
  for (size_t i = 0; fits && i < test["refused"].size(); ++i)
    fits = message.find(test["refused"][i].get<std::string>()) != std::string::npos;
  return fits;
}

// The number of cases in a file that fail; each one is printed. A file with too few cases counts as
// one failure.
int num_wrong(const char* name, const std::function<Json(const std::string&)>& read) {
  const Json file = load(name);
  int wrong = file["cases"].size() < kFewestCases;
  for (const Json& test : file["cases"]) {
    std::string found;
    bool is_right = false;
    try {
      const Json values = read(text_of(file, test));
      // Compares as plain JSON, so that the order of an object's entries does not matter.
      is_right =
          test.contains("expect") && nlohmann::json(values) == nlohmann::json(test["expect"]);
      found = values.dump();
    } catch (const BadInput& e) {
      is_right = is_refused_as(test, e.what());
      found = std::string("refused: ") + e.what();
    }
    if (is_right) continue;
    ++wrong;
    std::printf("%s: %s: %s\n", name, test["name"].get<std::string>().c_str(), found.c_str());
  }
  return wrong;
}

std::string chosen(const NamedCameras& cameras, const Json& row) {
  double K[9] = {0, 0, 0, 0, 0, 1, 0, 0, 1};
  const bool has_K = !row["fx"].is_null();
  if (has_K) {
    K[0] = K[4] = row["fx"];
    K[2] = row["cx"];
  }
  try {
    const tv_camera* const camera = choose_camera(cameras, row["image"], has_K ? K : nullptr);
    for (const auto& [name, entry] : cameras)
      if (&entry == camera) return name;
    return "none";
  } catch (const BadInput&) {
    return "ambiguous";
  }
}

int num_wrong_choices() {
  int wrong = 0;
  const Json file = load("choice.json");
  for (const Json& test : file["cases"]) {
    NamedCameras cameras;
    for (const auto& [name, values] : test["cameras"].items()) {
      tv_camera camera{};
      camera.model = TV_CAMERA_BROWN_CONRADY;
      camera.width = camera.height = 8;
      camera.fx = camera.fy = values[0];
      camera.cx = values[1];
      camera.k[0] = values[2];
      cameras.emplace_back(name, camera);
    }
    for (const Json& row : test["chosen"]) {
      const std::string entry = chosen(cameras, row);
      if (entry == row["entry"]) continue;
      ++wrong;
      std::printf("choice.json: %s: %s: %s\n", test["name"].get<std::string>().c_str(),
                  row.dump().c_str(), entry.c_str());
    }
  }
  return wrong;
}

// Every pair of names in both orders, so that the order is one and does not depend on a sort.
int num_wrong_orders() {
  int wrong = 0;
  const Json file = load("names.json");
  for (const Json& test : file["cases"]) {
    const auto names = test["names"].get<std::vector<std::string>>();
    for (size_t i = 0; i < names.size(); ++i)
      for (size_t j = 0; j < names.size(); ++j) {
        if (comes_before(names[i], names[j]) == (i < j)) continue;
        ++wrong;
        std::printf("names.json: %s: %s, %s\n", test["name"].get<std::string>().c_str(),
                    names[i].c_str(), names[j].c_str());
      }
  }
  return wrong;
}

int num_wrong_copies() {
  int wrong = 0;
  const std::map<std::string, CopyMark> marks = {{"word", CopyMark::kWord},
                                                 {"number", CopyMark::kNumber},
                                                 {"bare number", CopyMark::kBareNumber}};
  const Json file = load("copies.json");
  for (const Json& test : file["cases"]) {
    const auto name = test["name"].get<std::string>();
    const CopyMark mark =
        test["mark"].is_null() ? CopyMark::kNone : marks.at(test["mark"].get<std::string>());
    const CopyName found = copy_name(name);
    if (found.mark == mark && found.original == test["original"].get<std::string>()) continue;
    ++wrong;
    std::printf("copies.json: %s: %d, %s\n", name.c_str(), static_cast<int>(found.mark),
                found.original.c_str());
  }
  return wrong;
}

// What a case's mask uses of the picture, row by row, or the line of the refusal.
Json mask_json(const Json& test, const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, lines] : test["files"].items()) {
    fs::create_directories((folder / name).parent_path());
    std::ofstream file(folder / name);
    for (const Json& line : lines) file << line.get<std::string>() << "\n";
  }
  Masks masks;
  const auto given = test["given"].get<std::string>();
  masks.path = given.empty() ? folder.string() : (folder / given).string();
  try {
    const cv::Mat mask = masks.of(test["picture"], test["size"][0], test["size"][1]);
    Json rows = Json::array();
    for (int y = 0; y < mask.rows; ++y) {
      std::string row;
      for (int x = 0; x < mask.cols; ++x) row += mask.at<uint8_t>(y, x) != 0 ? '1' : '0';
      rows.push_back(row);
    }
    return rows;
  } catch (const BadInput& e) {
    return e.what();
  }
}

int num_wrong_masks() {
  int wrong = 0;
  const Json file = load("masks.json");
  const fs::path folder = fs::temp_directory_path() / ("masks." + std::to_string(::getpid()));
  for (const Json& test : file["cases"]) {
    const Json found = mask_json(test, folder);
    bool right = found == test.value("used", Json());
    if (test.contains("refused")) {
      const std::string line = found.is_string() ? found.get<std::string>() : "";
      right = line.rfind("--mask: ", 0) == 0;
      for (const Json& word : test["refused"])
        right = right && line.find(word.get<std::string>()) != std::string::npos;
    }
    if (right) continue;
    ++wrong;
    std::printf("masks.json: %s: %s\n", test["name"].get<std::string>().c_str(),
                found.dump().c_str());
  }
  fs::remove_all(folder);
  return wrong;
}

void test_masks_are_read_as_the_cases_say() { TEST_ASSERT_EQUAL_INT(0, num_wrong_masks()); }

void test_names_are_in_the_cases_order() { TEST_ASSERT_EQUAL_INT(0, num_wrong_orders()); }

void test_names_of_copies_are_those_of_the_cases() { TEST_ASSERT_EQUAL_INT(0, num_wrong_copies()); }

void test_pairs_files_are_read_as_the_cases_say() {
  TEST_ASSERT_EQUAL_INT(0, num_wrong("pairs.json", pairs_json));
}

void test_camera_files_are_read_as_the_cases_say() {
  const auto read = [](const std::string& text) {
    return camera_json(parse_camera(text, "the file"));
  };
  TEST_ASSERT_EQUAL_INT(0, num_wrong("camera.json", read));
}

void test_camera_sets_are_read_as_the_cases_say() {
  TEST_ASSERT_EQUAL_INT(0, num_wrong("cameras.json", camera_set_json));
}

void test_files_of_every_format_are_read_as_the_cases_say() {
  TEST_ASSERT_EQUAL_INT(0, num_wrong("camera_formats.json", camera_formats_json));
}

void test_the_entry_that_serves_an_image_is_the_cases() {
  TEST_ASSERT_EQUAL_INT(0, num_wrong_choices());
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_pairs_files_are_read_as_the_cases_say);
  RUN_TEST(test_camera_files_are_read_as_the_cases_say);
  RUN_TEST(test_camera_sets_are_read_as_the_cases_say);
  RUN_TEST(test_files_of_every_format_are_read_as_the_cases_say);
  RUN_TEST(test_the_entry_that_serves_an_image_is_the_cases);
  RUN_TEST(test_masks_are_read_as_the_cases_say);
  RUN_TEST(test_names_are_in_the_cases_order);
  RUN_TEST(test_names_of_copies_are_those_of_the_cases);
  return UNITY_END();
}
