// SPDX-License-Identifier: Apache-2.0
// Pictures of known error against audits of them. Intervals of 95 % that are right miss more than 26 times of 300 with
// probability 0.003, fewer than 4 times with 0.0002. Power: such of 88 % are found out with probability 0.96.
#include "methods/audit.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "image/metrics.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kRepetitions = 300;
constexpr int kMostMisses = 26, kFewestMisses = 4;

// --- a truth that is known -------------------------------------------------------------------------------------------

// Five decades of brightness, black too.
Image truthPicture(int width = 40, int height = 24) {
  Image b(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float v = x == 0 ? 0 : std::pow(10.f, -3 + 5 * static_cast<float>(x) / static_cast<float>(width));
      b.at(x, y) = Rgb(v, 0.5f * v, 0.1f + static_cast<float>(y) / 20);
    }
  return b;
}

// Exponential noise: the standard deviation is the mean, one sample in five is below a fifth of it.
Audit::Truth noisy(const Image& b) {
  return [&b](int x, int y, const SampleId& id) {
    Sampler sampler(id);
    Rgb p = b.at(x, y);
    for (int c = 0; c < 3; ++c) p[c] *= -std::log(1 - sampler.random());
    return p;
  };
}

template <class Change>
Image changed(const Image& b, const Change& change) {
  Image a = b;
  for (Rgb& p : a.pixels)
    for (int c = 0; c < 3; ++c) p[c] = change(p[c]);
  return a;
}

AuditResult audited(const Image& picture, const Audit::Truth& truth, uint64_t seed, int rounds, int pixels = 32) {
  Audit audit(picture, truth, seed, pixels);
  for (int i = 0; i < rounds; ++i) audit.round();
  return audit.result().value();
}

bool covers(const Estimated& e, double truth) { return e.low <= truth && truth <= e.high; }

struct Record {
  int biasMissed = 0, relMseMissed = 0;  ///< the truth is outside
  stats::Moments bias, relMse;
};

Record record(const Image& picture, const Image& b, int pixels = 32, int rounds = 32, int repetitions = kRepetitions) {
  const Metrics truth = compare(picture, b);
  Record out;
  for (int i = 0; i < repetitions; ++i) {
    const AuditResult r = audited(picture, noisy(b), static_cast<uint64_t>(i), rounds, pixels);
    out.biasMissed += covers(r.bias, truth.bias) ? 0 : 1;
    out.relMseMissed += covers(r.relMse, truth.relMse) ? 0 : 1;
    out.bias.add(r.bias.value);
    out.relMse.add(r.relMse.value);
  }
  return out;
}

// Intervals hold the truth as often as they claim, and their centres scatter around it: of relative errors, to 1 %.
void expectHonest(const Record& r, const Metrics& truth, const std::string& what) {
  EXPECT_LE(r.biasMissed, kMostMisses) << what;
  EXPECT_LE(r.relMseMissed, kMostMisses) << what;
  EXPECT_LT(std::fabs(r.bias.mean() - truth.bias), 3.5 * r.bias.standardError() + 0.01 * std::fabs(truth.bias)) << what;
  EXPECT_LT(std::fabs(r.relMse.mean() - truth.relMse), 3.5 * r.relMse.standardError() + 0.01 * truth.relMse) << what;
}

TEST(Audit, CoversTheErrorOfAPictureThatIsScaled) {
  const Image b = truthPicture(), a = changed(b, [](float v) { return 1.05f * v; });
  const Record r = record(a, b);
  expectHonest(r, compare(a, b), "5 % too bright");
  EXPECT_GE(r.biasMissed, kFewestMisses) << "the interval is too wide";
}

TEST(Audit, CoversAnErrorThatIsAdded) {
  const Image b = truthPicture(), a = changed(b, [](float v) { return v + 0.05f; });
  expectHonest(record(a, b), compare(a, b), "fog all over");
}

TEST(Audit, CoversAPictureWithNothingButNoise) {
  const Image b = truthPicture();
  Pcg32 random(7);
  const Image a = changed(b, [&](float v) { return v * (0.7f + 0.6f * random.next()); });
  expectHonest(record(a, b), compare(a, b), "noise");
}

TEST(Audit, FindsNothingInTheTruthItself) {
  const Image b = truthPicture();
  expectHonest(record(b, b), compare(b, b), "the truth");
}

TEST(Audit, CoversPicturesOfOneAndOfFewPixels) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(3, 2)}) {
    const Image b(width, height, Rgb(0.2f, 0.4f, 3.f)), a(width, height, Rgb(0.25f, 0.4f, 3.1f));
    const Record r = record(a, b, width * height, 128);
    expectHonest(r, compare(a, b), "few pixels");
    EXPECT_GE(r.biasMissed, kFewestMisses) << "the interval is too wide";
  }
}

// Power: 5 % are told from 4 % by more than nine audits in ten, and squared errors of 1.05 from those of 1.08.
TEST(Audit, ExcludesAnotherBias) {
  const Image b = truthPicture();
  const Image a = changed(b, [](float v) { return 1.05f * v; });
  const Metrics lessBias = compare(changed(b, [](float v) { return 1.03f * v; }), b);
  const Metrics moreError = compare(changed(b, [](float v) { return 1.08f * v; }), b);
  int biasTold = 0, errorTold = 0;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const AuditResult r = audited(a, noisy(b), seed, 256);
    biasTold += covers(r.bias, lessBias.bias) ? 0 : 1;
    errorTold += covers(r.relMse, moreError.relMse) ? 0 : 1;
  }
  EXPECT_GE(biasTold, 45);
  EXPECT_GE(errorTold, 45);
}

// Plain 1 / (p^2 + 0.01) of a noisy p overrates errors; the jackknife takes most of that away.
TEST(Audit, CorrectsTheDenominators) {
  const Image b(16, 16, Rgb(0.5f)), a(16, 16, Rgb(0.75f));
  stats::Moments corrected, correction;
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const AuditResult r = audited(a, noisy(b), seed, 32);
    corrected.add(r.relMse.value);
    correction.add(r.correction);
  }
  const double truth = compare(a, b).relMse;
  EXPECT_GT(correction.mean(), 0.02 * truth) << "there is nothing to correct: the test cannot fail";
  EXPECT_LT(std::fabs(corrected.mean() - truth), 0.2 * correction.mean() + 3 * corrected.standardError());
}

TEST(Audit, SaysWhenItWasTooShort) {
  const Image b(64, 64, Rgb(0.5f)), a(64, 64, Rgb(1.f));
  EXPECT_TRUE(audited(a, noisy(b), 1, 2, 512).tooShort());
  EXPECT_FALSE(audited(a, noisy(b), 1, 256).tooShort());
}

TEST(Audit, LeavesOutAndCountsWhatIsNotFinite) {
  const Image b = truthPicture();
  Image a = changed(b, [](float v) { return 1.05f * v; });
  for (int y = 0; y < a.height; ++y) a.at(7, y).g = std::numeric_limits<float>::quiet_NaN();
  const AuditResult r = audited(a, noisy(b), 1, 16);
  EXPECT_NEAR(static_cast<double>(r.nonFinite), 1024 / 40., 12);
  EXPECT_LT(std::fabs(r.bias.value - compare(a, b).bias), 0.02);
  for (Rgb& p : a.pixels) p = Rgb(std::numeric_limits<float>::infinity());
  Audit hopeless(a, noisy(b), 1, 4);
  hopeless.round();
  EXPECT_FALSE(hopeless.result().has_value());
}

TEST(Audit, ARoundThatIsStoppedDoesNotCount) {
  const Image b = truthPicture();
  std::stop_source stop;
  Audit audit(b, noisy(b), 1, 8);
  EXPECT_TRUE(audit.round(stop.get_token()));
  const double before = audit.result()->relMse.value;
  stop.request_stop();
  EXPECT_FALSE(audit.round(stop.get_token()));
  EXPECT_EQ(audit.rounds(), 1);
  EXPECT_EQ(audit.result()->relMse.value, before);
}

// --- path as the truth -----------------------------------------------------------------------------------------------

SceneSnapshot fog(int width, int height, const std::string& crop = "") {
  return sceneOf(fmt::format(
      R"(<integrator type="volpath"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective"><float name="fov" value="40"/>
      <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/><rfilter type="box"/>{}</film></sensor>
    <emitter type="point"><point name="position" x="-2" y="3" z="2"/><rgb name="intensity" value="40, 30, 20"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>
    <shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous">
      <float name="sigma_t" value="1.5"/><float name="albedo" value="0.9"/></medium></shape>)",
      width, height, crop));
}

Image converged(const SceneSnapshot& scene, int passes = 2048) {
  return rendered(scene, {.passes = passes, .seed = 1234}).film().beauty();
}

// 40 intervals of 95 %: more than six miss with probability 0.003.
TEST(AuditOfPath, TellsTheBiasOfAPicture) {
  const SceneSnapshot scene = fog(12, 8);
  const Image b = converged(scene, 16384);  // 50 times the samples of an audit
  for (const float factor : {1.f, 1.05f}) {
    const Image a = changed(b, [&](float v) { return factor * v; });
    const Metrics truth = compare(a, b);
    int missed = 0, told = 0;
    for (uint64_t seed = 0; seed < 40; ++seed) {
      const AuditResult r = audited(a, pathTruth(*scene), seed, 8);
      missed += covers(r.bias, truth.bias) ? 0 : 1;
      told += covers(r.bias, truth.bias + 0.05) ? 0 : 1;
    }
    EXPECT_LE(missed, 6) << factor;
    EXPECT_GE(told, 36) << factor << ": 5 % of bias more would not have been noticed";
  }
}

TEST(AuditOfPath, FindsWhatTooShortPathsLeaveOut) {
  const SceneSnapshot scene = fog(12, 8);
  const Image a = rendered(scene, {.passes = 512, .settings = {{"max_depth", "2"}}}).film().beauty();
  const double truth = compare(a, converged(scene)).bias;
  const AuditResult r = audited(a, pathTruth(*scene), 1, 64);
  EXPECT_LT(r.bias.high, 0);
  EXPECT_LT(truth, -0.02);
  EXPECT_LT(std::fabs(r.bias.value - truth), r.bias.high - r.bias.low);
}

TEST(AuditOfPath, LooksWhereTheCropIs) {
  const std::string crop = R"(<integer name="crop_offset_x" value="{}"/><integer name="crop_offset_y" value="3"/>
    <integer name="crop_width" value="5"/><integer name="crop_height" value="4"/>)";
  const SceneSnapshot left = fog(16, 12, fmt::format(fmt::runtime(crop), 0));
  const SceneSnapshot middle = fog(16, 12, fmt::format(fmt::runtime(crop), 6));
  const Image picture = converged(left);
  const AuditResult right = audited(picture, pathTruth(*left), 3, 64);
  EXPECT_LT(right.bias.low, 0.02);
  EXPECT_GT(right.bias.high, -0.02);
  EXPECT_LT(right.relMse.high, 0.01);
  EXPECT_GT(audited(picture, pathTruth(*middle), 3, 64).relMse.low, 0.05);
}

TEST(AuditOfPath, LooksAtTheOnlyPixel) {
  const SceneSnapshot scene = fog(1, 1);
  const Image a = changed(converged(scene, 8192), [](float v) { return 1.1f * v; });
  const AuditResult r = audited(a, pathTruth(*scene), 1, 256, 1);
  EXPECT_GT(r.bias.low, 0.05);
  EXPECT_LT(r.bias.high, 0.15);
}

TEST(AuditOfPath, DoesOneRoundAtLeastButNoneAfterAStop) {
  const SceneSnapshot scene = fog(64, 64);
  const Image a = converged(scene, 16);
  const auto shortest = auditPicture(*scene, a, {.seconds = 1e-9}).value();
  EXPECT_EQ(shortest.samples, Audit::kGroups);
  EXPECT_EQ(shortest.pixels, 32 * Audit::kPanels);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(auditPicture(*scene, a, {.seconds = 1e9}, stop.get_token()).has_value());
}

TEST(AuditOfPath, OfASmallPictureLooksAtAllOfIt) {
  const SceneSnapshot scene = fog(3, 2);
  EXPECT_EQ(auditPicture(*scene, converged(scene, 16), {.seconds = 1e-9})->pixels, 6 * Audit::kPanels);
}

TEST(AuditOfPath, DrawsOtherNumbersThanTheRender) {
  const SceneSnapshot scene = fog(1, 1);
  const Image a = rendered(scene, {.passes = 1, .seed = 5}).film().beauty();
  const auto r = auditPicture(*scene, a, {.seconds = 1e-9, .seed = 5}).value();
  EXPECT_NE(r.relMse.value, 0);
  EXPECT_NE(r.bias.value, auditPicture(*scene, a, {.seconds = 1e-9, .seed = 6})->bias.value);
}

}  // namespace
}  // namespace virga
