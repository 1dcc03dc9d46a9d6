// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "methods/method.h"

namespace virga {

/// One picture in the making: a scene, a method and the film between them. Runs pass after pass, survives edits.
class RenderSession {
 public:
  struct Options {
    Settings settings;
    LayerMask layers = LayerMask::none();
  };

  /// Throws Error for settings that the method refuses.
  RenderSession(SceneSnapshot, const MethodInfo&, Options);

  /// One pass. An aborted pass leaves the film as it was.
  PassResult step(const Budget& = {}, std::stop_token = {});
  /// The scene changes; the film and the method forget what no longer holds.
  void edit(SceneSnapshot next, const ChangeSet&);
  /// The next frame of a sequence: as an edit, and the film starts anew even where nothing changed.
  void nextFrame(SceneSnapshot next, const ChangeSet&);

  const Film& film() const { return *film_; }
  const Scene& scene() const { return *scene_; }
  const MethodInfo& info() const { return *info_; }
  const Method& method() const { return *method_; }
  const Settings& settings() const { return options_.settings; }
  int64_t passes() const { return nextPass_; }

 private:
  void restart();

  SceneSnapshot scene_;
  const MethodInfo* info_;
  Options options_;
  std::unique_ptr<Method> method_;
  std::unique_ptr<Film> film_;
  int64_t nextPass_ = 0;
};

}  // namespace virga
