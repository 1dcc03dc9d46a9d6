// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/options.h"
#include "app/output_files.h"
#include "app/usage_error.h"
#include "core/atomic_write.h"
#include "core/error.h"
#include "image/film.h"
#include "image/image_io.h"
#include "image/metrics.h"

namespace virga::app {
namespace {

/// One plane of a file: the picture and, where the file has it, its variance.
struct Plane {
  Image image;
  std::optional<Image> variance;
  int replicates = Film::kReplicates;
};

std::vector<std::string> namesOf(const LayeredImage::Named& layers) {
  std::vector<std::string> names;
  for (const auto& [name, image] : layers) names.push_back(name);
  return names;
}

[[noreturn]] void failMissingLayer(const std::string& path, const std::string& layer, const LayeredImage& file) {
  const std::vector<std::string> names = namesOf(file.layers);
  throw Error(fmt::format("\"{}\" has no layer \"{}\"", path, layer),
              {.position = {},
               .hint = didYouMean(layer, names),
               .notes = {names.empty() ? "it has no layers: render it with --layers" : "available: " + joined(names)}});
}

int replicatesOf(const LayeredImage& file) {
  const auto found = file.metadata.find("virga.replicates");
  if (found == file.metadata.end()) return Film::kReplicates;
  const auto* count = std::get_if<int64_t>(&found->second);
  return count && *count >= 2 && *count < 1'000'000 ? static_cast<int>(*count) : Film::kReplicates;
}

Plane readPlane(const std::string& path, const std::string& layer) {
  LayeredImage file = readLayeredImage(path);
  const int replicates = replicatesOf(file);
  if (layer.empty()) return {std::move(file.beauty), std::move(file.variance), replicates};
  const Image* image = file.layer(layer);
  if (!image) failMissingLayer(path, layer, file);
  const Image* variance = file.layerVariance(layer);
  return {*image, variance ? std::optional<Image>(*variance) : std::nullopt, replicates};
}

std::optional<Agreement> agreementOf(const Plane& a, const Plane& b) {
  if (!a.variance || !b.variance) return std::nullopt;
  return testAgreement(a.image, {*a.variance, a.replicates}, b.image, {*b.variance, b.replicates});
}

// JSON knows no infinity: the PSNR of equal pictures is null.
nlohmann::ordered_json number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

std::string jsonText(const Metrics& m, const std::optional<Agreement>& t) {
  nlohmann::ordered_json json = {{"mse", number(m.mse)},        {"relmse", number(m.relMse)},
                                 {"mape", number(m.mape)},      {"psnr", number(m.psnr)},
                                 {"bias", number(m.bias)},      {"excess", number(m.excess)},
                                 {"max_abs", number(m.maxAbs)}, {"pixels", m.pixels},
                                 {"non_finite", m.nonFinite},   {"reference_non_finite", m.referenceNonFinite}};
  if (t)
    json["t_test"] = {{"tests", t->tests},
                      {"beyond_2", t->beyond2},
                      {"expected_beyond_2", t->expectedBeyond2},
                      {"beyond_3", t->beyond3},
                      {"expected_beyond_3", t->expectedBeyond3},
                      {"chi_squared_per_dof", t->chiSquaredPerDof},
                      {"maximum_t", number(t->maximumT)},
                      {"maximum_p", t->maximumP},
                      {"certain", t->certain},
                      {"non_finite", t->nonFinite}};
  return json.dump(2);
}

void printMetrics(const Metrics& m, int64_t pixels) {
  if (m.pixels < pixels)
    fmt::print("only {} of {} pixels compared: {} of the image and {} of the reference are NaN or infinite\n", m.pixels,
               pixels, m.nonFinite, m.referenceNonFinite);
  fmt::print("MSE     {:.6g}\n", m.mse);
  fmt::print("relMSE  {:.6g}\n", m.relMse);
  fmt::print("MAPE    {:.4g} %\n", 100 * m.mape);
  fmt::print("PSNR    {:.4g} dB\n", m.psnr);
  fmt::print("bias    {:+.4g} %  (mean signed relative difference)\n", 100 * m.bias);
  fmt::print("max     {:.6g}\n", m.maxAbs);
}

void printAgreement(const Agreement& t) {
  if (t.tests == 0) return fmt::print("t-test  no value has a variance to test by\n");
  fmt::print("t-test  {} values: {:.2f} % beyond 2 (expected {:.2f} %), {:.3f} % beyond 3 (expected {:.3f} %)\n",
             t.tests, 100 * t.beyond2, 100 * t.expectedBeyond2, 100 * t.beyond3, 100 * t.expectedBeyond3);
  fmt::print(
      "        chi^2 per degree of freedom {:.4f}, largest |t| {:.2f} (p = {:.3g} for the most unlikely of all)\n",
      t.chiSquaredPerDof, t.maximumT, t.maximumP);
  if (t.certain > 0) fmt::print("        {} values differ without noise on either side\n", t.certain);
}

}  // namespace

int compare(const CompareOptions& options) {
  if (!options.difference.empty()) {
    if (outputFormat(options.difference) != OutputFormat::png) throw UsageError("--diff writes a .png");
    checkNotInput(options.difference, {options.image, options.reference});
    checkWritable(options.difference);
  }
  const Plane image = readPlane(options.image, options.layer), reference = readPlane(options.reference, options.layer);
  const Metrics metrics = virga::compare(image.image, reference.image);
  const auto agreement = agreementOf(image, reference);
  if (!options.difference.empty()) writePng(options.difference, signedDifference(image.image, reference.image));
  if (options.json) {
    fmt::print("{}\n", jsonText(metrics, agreement));
  } else {
    printMetrics(metrics, static_cast<int64_t>(image.image.pixels.size()));
    if (agreement) printAgreement(*agreement);
  }
  return 0;
}

}  // namespace virga::app
