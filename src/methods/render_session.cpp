// SPDX-License-Identifier: Apache-2.0
#include "methods/render_session.h"

namespace virga {

RenderSession::RenderSession(SceneSnapshot scene, const MethodInfo& info, Options options)
    : scene_(std::move(scene)), info_(&info), options_(std::move(options)), method_(info.create()) {
  method_->prepare(scene_, options_.settings, options_.layers);
  film_ = std::make_unique<Film>(scene_->camera.width, scene_->camera.height, options_.layers);
}

PassResult RenderSession::step(const Budget& budget, std::stop_token stop) {
  const PassResult result = method_->pass(nextPass_, budget, std::move(stop), film_->frame());
  if (!result.completed) return result;
  if (result.kind == PassResult::Kind::averaged)
    film_->average(static_cast<int>(nextPass_ % Film::kReplicates));
  else
    film_->replace();
  ++nextPass_;
  return result;
}

void RenderSession::edit(SceneSnapshot next, const ChangeSet& changes) {
  scene_ = std::move(next);
  const Reset reset = method_->update(scene_, changes);
  const bool resized = film_->width() != scene_->camera.width || film_->height() != scene_->camera.height;
  if (resized) film_ = std::make_unique<Film>(scene_->camera.width, scene_->camera.height, options_.layers);
  if (reset != Reset::nothingLost || resized) restart();
}

void RenderSession::nextFrame(SceneSnapshot next, const ChangeSet& changes) {
  edit(std::move(next), changes);
  restart();
}

void RenderSession::restart() {
  film_->clear();
  nextPass_ = 0;
}

}  // namespace virga
