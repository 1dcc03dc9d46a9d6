// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "image/film.h"
#include "scene/scene.h"

namespace virga {

/// What a pass may spend.
struct Budget {
  double seconds = std::numeric_limits<double>::infinity();
  float resolutionScale = 1;  ///< of the picture that an interactive pass may compute before it upsamples
};

/// What a method made of an edit: how much of what was computed is still of use.
enum class Reset {
  nothingLost,  ///< the film goes on as it is
  film,         ///< the film starts anew; the method keeps its caches
  caches,       ///< everything starts anew
};

struct PassResult {
  enum class Kind {
    averaged,  ///< an independent estimate: one more sample of its replicate
    replaced,  ///< a refined picture: takes the place of what was there
  };
  Kind kind = Kind::averaged;
  bool completed = true;   ///< false: stopped on the way; the frame does not count
  bool biased = false;     ///< expectation of the picture differs from the truth
  bool converged = false;  ///< more passes change nothing
  std::optional<double> residual =
      std::nullopt;  ///< where the method has one: an estimate of the relative distance to its fixed point
};

/// Things to draw over the picture: virtual lights, samples, particles.
struct Overlay {
  struct Dot {
    Vec3 position;  ///< world
    Rgb color;
  };
  std::vector<Dot> dots;
};

/// Values of a method's parameters as text, by name without the method's prefix.
using SettingValues = std::map<std::string, std::string, std::less<>>;

/// Parameters of a method (`--set path.max_depth=8`) and the numbers that fix its randomness.
struct Settings {
  SettingValues values;
  uint64_t seed = 0;
};

/// One parameter of a method, as `virga methods NAME` lists it.
struct SettingInfo {
  std::string_view name, defaultValue, summary;
};

/// A rendering method. Averaged passes are pure functions of (snapshot, settings, seed, replicate, index), unless a
/// setting says that something is kept from frame to frame of a sequence: then their expectation is.
class Method {
 public:
  virtual ~Method() = default;

  /// Once, before anything else; may be slow. `layers` are those that the film stores besides the beauty. Throws Error
  /// for settings it does not know or cannot take.
  virtual void prepare(SceneSnapshot, const Settings&, LayerMask layers) = 0;

  /// The scene is `next` from now on; `changes` lists all that differs. Says what survives.
  virtual Reset update(SceneSnapshot next, const ChangeSet& changes) = 0;

  /// Fills the whole frame with pass `index` (0, 1, ...; it belongs to replicate index % Film::kReplicates). Returns
  /// within 20 ms of a stop request.
  virtual PassResult pass(int64_t index, const Budget&, std::stop_token, PassFrame&) = 0;

  /// Every parameter of the registry's row with the value that is in force, wherever it came from.
  virtual SettingValues settingsInForce() const = 0;

  virtual Overlay overlay() const { return {}; }
  /// Everything besides (snapshot, settings, film) that the expectation of later passes depends on; empty for methods
  /// with pure passes, and where what is kept from frame to frame decides their noise alone.
  virtual std::string saveState() const { return {}; }
  virtual void loadState(std::string_view) {}
};

enum class Accuracy { unbiased, consistent, biased };

/// A row of the registry.
struct MethodInfo {
  std::string_view name;
  std::string_view summary;  ///< one line
  std::string_view paper;
  LayerMask layers;  ///< those it fills
  Accuracy accuracy;
  std::span<const SettingInfo> settings;
  std::unique_ptr<Method> (*create)();
};

/// All methods, in the order in which they are listed.
std::span<const MethodInfo> methodRegistry();

/// Throws Error with a suggestion where there is none of that name.
const MethodInfo& findMethod(std::string_view name);

/// "unbiased", "consistent", "biased".
std::string_view accuracyName(Accuracy);

}  // namespace virga
