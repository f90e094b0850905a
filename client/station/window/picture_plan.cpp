#include "client/station/window/picture_plan.h"

#include <algorithm>

namespace needlelab {

std::vector<PictureRequest> PicturePlan::due(Stage stage, double lesson_s) {
  constexpr int kSettled = 3;
  frames_ = stage == last_ ? frames_ + 1 : 1;
  last_ = stage;
  std::vector<PictureRequest> now;
  for (std::size_t i = 0; i < pictures_.size(); ++i) {
    if (taken_[i]) continue;
    const PictureRequest& picture = pictures_[i];
    const bool is_due = picture.when == PictureRequest::When::kLesson
                            ? stage == Stage::kLesson && frames_ >= kSettled && lesson_s >= picture.at_s
                        : picture.when == PictureRequest::When::kStart
                            ? stage == Stage::kStart && frames_ >= kSettled
                            : stage == Stage::kEnd && frames_ >= kSettled;
    if (!is_due) continue;
    taken_[i] = true;
    now.push_back(picture);
  }
  return now;
}

bool PicturePlan::done() const {
  return std::find(taken_.begin(), taken_.end(), false) == taken_.end();
}

std::vector<PictureRequest> PicturePlan::missing() const {
  std::vector<PictureRequest> left;
  for (std::size_t i = 0; i < pictures_.size(); ++i)
    if (!taken_[i]) left.push_back(pictures_[i]);
  return left;
}

}  // namespace needlelab
