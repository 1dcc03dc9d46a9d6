// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>
#include <utility>

#include "app/audit_report.h"
#include "app/dots.h"
#include "app/frames.h"
#include "app/interrupt.h"
#include "app/method_settings.h"
#include "app/options.h"
#include "app/output_files.h"
#include "app/progress.h"
#include "app/render_loop.h"
#include "app/render_report.h"
#include "app/scene_source.h"
#include "app/stopwatch.h"
#include "app/usage_error.h"
#include "core/atomic_write.h"
#include "scene/builder.h"

namespace virga::app {
namespace {

// Runs `step`, and says how long it took.
template <class Step>
auto timed(double& seconds, const Step& step) {
  const Stopwatch watch;
  auto result = step();
  seconds = watch.seconds();
  return result;
}

std::vector<std::string> outputsOf(const RenderOptions& options) {
  if (!options.outputs.empty()) return options.outputs;
  return {std::filesystem::path(options.scene.file).stem().string() + ".exr"};
}

// An --error that a method cannot keep is refused before it has cost hours.
void requireErrorEstimate(const RenderOptions& options, const MethodInfo& method) {
  if (!options.stop.relMse || options.auditSeconds || method.accuracy != Accuracy::biased) return;
  throw Error(fmt::format("--error: \"{}\" is biased, so its noise does not tell its error", method.name),
              {.position = {}, .hint = "add --audit SEC, or use --passes or --time", .notes = {}});
}

StopRules rulesFor(const RenderOptions& options, const Scene& scene) {
  StopRules rules = options.stop;
  if (!rules.any()) rules.passes = scene.integrator.sampleCount;
  return rules;
}

// The film holds a picture for each replicate and one for the pass in the making. To be refused here is better than to
// be killed by the system for memory it promised and does not have.
void requireMemory(const Scene& scene, LayerMask layers) {
  const double pixels = static_cast<double>(scene.camera.width) * scene.camera.height;
  const double planes = layers == LayerMask::none() ? 1 : kLayerCount;
  const double needed = pixels * sizeof(Rgb) * planes * (Film::kReplicates + 2);
  const double available =
      static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  if (needed <= available) return;
  throw Error(fmt::format("a picture of {} x {} pixels needs {} of memory; this machine has {}", scene.camera.width,
                          scene.camera.height, bytesText(needed), bytesText(available)),
              {.position = {}, .hint = "choose a smaller --size", .notes = {}});
}

// " of 64 passes" where that was the aim, else " passes".
std::string intendedText(const StopRules& rules) {
  return rules.passes ? fmt::format(" of {} passes", *rules.passes) : std::string(" passes");
}

bool isBlack(const Image& image) {
  return std::all_of(image.pixels.begin(), image.pixels.end(), [](const Rgb& p) { return p == Rgb(0.f); });
}

// Errors of a sequence say in which frame they are.
Error inFrame(const Error& error, const FrameRange& range, int frame) {
  Error::Details details = error.details();
  details.notes.push_back(fmt::format("in frame {} of --frames {}..{}", frameText(frame), range.first, range.last));
  return Error(error.message(), std::move(details));
}

/// Renders one picture, or one after another: frames share the method's state and what does not change of the scene.
class RenderJob {
 public:
  RenderJob(const RenderOptions& options, Interrupt& interrupt, int threads)
      : options_(options), method_(findMethod(options.method)), interrupt_(interrupt), threads_(threads) {}

  /// The exit code.
  int run() {
    begin(options_.frames ? std::optional(options_.frames->first) : std::nullopt);
    checkCommand();
    requireInputsSafe({options_.scene.file});
    requireErrorEstimate(options_, method_);
    settings_ = methodSettings(method_, options_.settings, options_.seed);
    checkAllWritable(allPictures(), report_.stats);  // of a sequence: all frames go to one folder
    if (options_.frames) return renderSequence(*options_.frames);
    renderPicture();
    return 0;
  }

 private:
  enum class Outcome { written, interrupted };

  void checkCommand() const {
    checkNames(allPictures(), report_.stats);
    if (!options_.dots.empty() && outputFormat(options_.dots) != OutputFormat::png)
      throw UsageError("--dots writes a PNG");
    if (!options_.frames) return;
    if (options_.scene.defines.contains("frame")) throw UsageError("--frames and -D frame= both say what $frame is");
    if (isVolumeFile(options_.scene.file))
      throw UsageError(
          fmt::format("--frames: \"{}\" is a single volume; write a scene whose filename has $frame in "
                      "it, as \"virga make\" does",
                      options_.scene.file));
  }

  int renderSequence(const FrameRange& range) {
    constexpr int kInterruptedWithoutPicture = 130;
    for (int frame = range.first; frame <= range.last; ++frame) {
      if (frameOf(range, frame) == Outcome::written) continue;
      const bool none = frame == range.first;
      say("interrupted: {}\n",
          none ? "no frame is written" : fmt::format("frames {} to {} are written", range.first, frame - 1));
      return none ? kInterruptedWithoutPicture : 0;
    }
    return 0;
  }

  Outcome frameOf(const FrameRange& range, int frame) {
    if (interrupt_.requested()) return Outcome::interrupted;
    begin(frame);
    say("frame {} of {}..{}\n", frame, range.first, range.last);
    try {
      return renderPicture();
    } catch (const Error& error) {
      throw inFrame(error, range, frame);
    }
  }

  // What is reported and where it goes.
  void begin(std::optional<int> frame) {
    const auto named = [&](const std::string& path) { return frame ? fileOfFrame(path, *frame) : path; };
    report_ = {};
    report_.sceneFile = options_.scene.file;
    report_.frame = frame;
    for (const std::string& output : outputsOf(options_)) report_.outputs.push_back(named(output));
    report_.stats = named(options_.stats);
    report_.dots = named(options_.dots);
    report_.threads = threads_;
    report_.relMseLimit = options_.stop.relMse;
  }

  Outcome renderPicture() {
    const Stopwatch watch;
    const double cpuBefore = session_ ? cpuSeconds() : 0;
    const SceneSnapshot scene = loadAndBuild();
    requireMemory(*scene, layers());
    timed(report_.timings.prepare, [&] { return takeScene(scene); });
    renderPasses(*session_);
    const bool whole = report_.outcome.reason != StopReason::interrupted;
    if (report_.frame && !whole) return Outcome::interrupted;
    audit(*session_);
    write(*session_, watch, cpuBefore);
    return Outcome::written;
  }

  LayerMask layers() const { return options_.layers ? method_.layers : LayerMask::none(); }

  // The first scene begins a session, the following ones edit it. Says which.
  bool takeScene(const SceneSnapshot& scene) {
    const bool first = !session_;
    if (first)
      session_ = std::make_unique<RenderSession>(scene, method_, RenderSession::Options{settings_, layers()});
    else
      session_->nextFrame(scene, differences(session_->scene().description, scene->description));
    scene_ = scene;
    return first;
  }

  SceneSnapshot loadAndBuild() {
    SceneOptions options = options_.scene;
    if (report_.frame) options.frame = frameText(*report_.frame);
    const SceneDescription description =
        timed(report_.timings.load, [&] { return loadScene(options, report_.warnings); });
    requireInputsSafe(filesOf(description));
    SceneSnapshot scene;
    // To read large files takes a thread: another one hashes them meanwhile.
    tbb::parallel_invoke(
        [&] {
          const BuildOptions build{.filmSize = options_.size, .lenient = options_.scene.lenient};
          scene = timed(report_.timings.build, [&] { return buildScene(description, build, scene_); });
        },
        [&] { report_.sceneHash = contentHash(description); });
    report_.warnings.insert(report_.warnings.end(), scene->warnings.begin(), scene->warnings.end());
    for (const std::string& warning : report_.warnings)
      if (warned_.insert(warning).second) say("{}\n", warning);
    return scene;
  }

  void requireInputsSafe(const std::vector<std::filesystem::path>& inputs) const {
    for (const std::string& output : allPictures()) checkNotInput(output, inputs);
    checkNotInput(report_.stats, inputs);
  }

  void renderPasses(RenderSession& session) {
    const StopRules rules = rulesFor(options_, session.scene());
    Progress progress(options_.quiet ? Progress::Mode::silent : Progress::automatic(), rules);
    say("rendering {}: {} x {} pixels, {}, {} thread{}\n", report_.sceneFile, session.film().width(),
        session.film().height(), method_.name, report_.threads, report_.threads == 1 ? "" : "s");
    const double cpuBefore = cpuSeconds();
    report_.outcome = renderLoop(session, rules, interrupt_.token(), [&](const RenderState& s) { progress.show(s); });
    report_.timings.render = report_.outcome.state.seconds;
    report_.timings.renderCpu = cpuSeconds() - cpuBefore;
    progress.finish(report_.outcome.state);
    if (report_.outcome.reason == StopReason::interrupted && !report_.frame)
      say("interrupted: the picture holds {}{}\n", session.film().passes(), intendedText(rules));
  }

  // Only passes know of a bias that comes from a setting: --error has counted nothing but noise then.
  void warnOfBias(const RenderSession& session) {
    if (options_.auditSeconds || !report_.outcome.biased || report_.outcome.reason != StopReason::error) return;
    warn("{} is biased with these settings; --error has counted noise alone: add --audit SEC", session.info().name);
  }

  void audit(const RenderSession& session) {
    warnOfBias(session);
    if (!options_.auditSeconds) return;
    if (interrupt_.requested()) return say("no audit: interrupted\n");
    say("auditing for {}\n", durationText(*options_.auditSeconds));
    report_.audit = timed(report_.timings.audit, [&] {
      return auditPicture(session.scene(), session.film().beauty(), {*options_.auditSeconds, options_.seed},
                          interrupt_.token());
    });
    if (report_.audit)
      sayAudit(*report_.audit);
    else
      warn("no audit: {}", interrupt_.requested() ? "interrupted" : "the picture has no finite pixels");
  }

  void sayAudit(const AuditResult& audit) {
    say("{}", auditText(audit));
    if (audit.tooShort()) warn("the audit's relMSE may be off by more than it says: audit for longer");
    if (audit.nonFinite > 0) warn("{} of the audit's pixels were left out: NaN or infinite", audit.nonFinite);
    if (!options_.stop.relMse) return;
    const Verdict verdict = verdictOf(audit, *options_.stop.relMse);
    const std::string text = fmt::format("--error {:g}: {}", *options_.stop.relMse, verdictName(verdict));
    if (verdict == Verdict::reached)
      say("{}, says the audit\n", text);
    else
      warn("{}, says the audit", text);
  }

  void write(const RenderSession& session, const Stopwatch& total, double cpuBefore) {
    warnOfNonFinite(session.film());
    warnOfBlack(session);
    const auto shield = interrupt_.shield();
    const Stopwatch watch;
    writePictures(report_.outputs, developed(session, report_, options_.layers ? WithLayers::yes : WithLayers::no));
    if (!report_.dots.empty()) writeDots(session);
    report_.timings.write = watch.seconds();
    report_.timings.total = total.seconds();
    report_.timings.totalCpu = cpuSeconds() - cpuBefore;
    if (!report_.stats.empty()) writeAtomically(report_.stats, statsJson(session, report_));
    for (const std::string& path : allPictures()) say("wrote {}\n", path);
  }

  void writeDots(const RenderSession& session) {
    const Overlay overlay = session.method().overlay();
    if (overlay.dots.empty()) warn("--dots: method \"{}\" has nothing to draw", method_.name);
    writePng(report_.dots, withDots(session.film().beauty(), session.scene(), overlay));
  }
  std::vector<std::string> allPictures() const {
    std::vector<std::string> all = report_.outputs;
    if (!report_.dots.empty()) all.push_back(report_.dots);
    return all;
  }

  void warnOfNonFinite(const Film& film) {
    if (film.nonFiniteSamples() == 0) return;
    warn("{} samples were NaN or infinite: their pixels are so in the EXR and magenta in the PNG",
         film.nonFiniteSamples());
  }

  template <class... Args>
  void warn(fmt::format_string<Args...> format, Args&&... args) {
    report_.warnings.push_back(fmt::format(format, std::forward<Args>(args)...));
    say("warning: {}\n", report_.warnings.back());
  }

  void warnOfBlack(const RenderSession& session) {
    const SceneView& view = session.scene().view;
    const bool shines = view.hasLamps() || view.emissive;  // what does not has been warned of
    if (!shines || !isBlack(session.film().beauty())) return;
    report_.warnings.push_back(
        "every pixel is black: look at near_clip and far_clip, where the camera looks, the lights, the density of "
        "the medium, whether its grid lies inside its shape, and max_depth");
    say("warning: {}\n", report_.warnings.back());
  }

  template <class... Args>
  void say(fmt::format_string<Args...> format, Args&&... args) const {
    if (!options_.quiet) fmt::print(stderr, format, std::forward<Args>(args)...);
  }

  const RenderOptions& options_;
  const MethodInfo& method_;
  Interrupt& interrupt_;
  int threads_;
  Settings settings_;
  SceneSnapshot scene_;  ///< the last one
  std::unique_ptr<RenderSession> session_;
  std::set<std::string> warned_;
  RenderReport report_;
};

}  // namespace

int render(const RenderOptions& options) {
  Interrupt interrupt([&options] {
    if (options.quiet) return;
    fmt::print(stderr, "\nstopping: {}\n",
               options.frames ? "frames that are finished stay; once more: quit at once"
                              : "the picture is written; once more: quit at once, without it");
  });
  const int threads = options.threads > 0 ? options.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  tbb::task_arena arena(threads);
  return arena.execute([&] { return RenderJob(options, interrupt, threads).run(); });
}

}  // namespace virga::app
