#include "tests/support/reference/reference_models.h"

#include <algorithm>
#include <cmath>

#include "common/haptics/models/score_process.h"

namespace needlelab::test {
namespace {

// linear between rows, constant beyond the ends
template <class Row>
double tableAt(const std::vector<Row>& rows, double Row::*value, double scale, double depth_m) {
  if (depth_m <= rows.front().depth_m * scale) return rows.front().*value;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const double from = rows[i - 1].depth_m * scale, to = rows[i].depth_m * scale;
    if (depth_m < to)
      return rows[i - 1].*value + (rows[i].*value - rows[i - 1].*value) * (depth_m - from) / (to - from);
  }
  return rows.back().*value;
}

}  // namespace

double ReferenceModel::topOf(std::size_t layer) const {
  double top = 0;
  for (std::size_t i = 0; i < layer; ++i) top += scene_.layers[i].thickness_m;
  return top;
}

std::size_t ReferenceModel::layerAt(double depth_m) const {
  std::size_t layer = 0;
  for (std::size_t i = 0; i < scene_.layers.size(); ++i)
    if (depth_m >= topOf(i)) layer = i;
  return layer;
}

// "Axial models", STATISTICAL: log-normal with the table's mean and sd at this depth
double ReferenceModel::statisticalTarget(double depth_m) const {
  const StatisticalSpec& spec = scene_.statistical;
  using Row = StatisticalSpec::Row;
  const double mean = tableAt(spec.table, &Row::mean_N, spec.thickness_factor, depth_m) * spec.mean_factor;
  const double sd = tableAt(spec.table, &Row::sd_N, spec.thickness_factor, depth_m) * spec.mean_factor;
  if (mean == 0) return 0;
  ScorePath fresh;
  const double score = ScoreProcess(spec.correlation_length_m)
                           .at(scoreKey(spec.seed, static_cast<std::uint64_t>(insertion_)), depth_m, fresh);
  const double variance = std::log(1 + (sd / mean) * (sd / mean));
  return std::exp(std::log(mean) - variance / 2 + std::sqrt(variance) * score);
}

// "Tracking wall" with the model's own stretches
ModelForce ReferenceModel::wall(const ModelTick& tick, double cut_m, double attracted_m) {
  const double stiffness = scene_.tracking_wall.stiffness_N_per_m;
  const double rejection_m = scene_.layers[layerAt(tick.depth_m)].rejection_force_N / stiffness;
  stop_->step(tick.x_m, tick.x_m - wall_, tick.speed_mps, tick.p_W_m, tick.u_W);
  wall_ += stop_->wallMove(tick.x_m - wall_, rejection_m);
  wall_ = std::min(std::max(wall_, tick.x_m - cut_m),
                   tick.x_m + std::min(attracted_m, std::max(0.0, tick.depth_m) / tick.slant));
  const double force = -stiffness * (tick.x_m - wall_);
  ModelForce out;
  (force < 0 ? out.cutting_N : out.attracted_N) = force;
  return out;
}

// "Axial models", DIRECT: "−K·max(0, x); with step_at_layers at most the layer's cutting force"
ModelForce ReferenceModel::direct(const ModelTick& tick) const {
  double pressed = scene_.direct.stiffness_N_per_m * std::max(0.0, tick.x_m);
  if (scene_.direct.step_at_layers)
    pressed = std::min(pressed, scene_.layers[layerAt(tick.depth_m)].cutting_force_N);
  ModelForce out;
  out.cutting_N = -pressed;
  return out;
}

// "Axial models", VOIGT: "min(0, −K·x − B·ẋ), ẋ the difference over one tick", the tick before moved by the
// turn, 0 before entry
ModelForce ReferenceModel::voigt(const ModelTick& tick) const {
  const double rate = (tick.x_m - (x_past_ + tick.moved_m)) * rate_hz_;
  ModelForce out;
  out.cutting_N =
      std::min(0.0, -scene_.voigt.stiffness_N_per_m * tick.x_m - scene_.voigt.damping_Ns_per_m * rate);
  return out;
}

// the places where the tip first reached tops, like those of "Puncture": "x interpolated by δ between the
// tick before and this one"
void ReferenceModel::meetTops(const ModelTick& tick) {
  const double x_before = tick.entry ? 0 : x_past_ + tick.moved_m;
  const double depth_before = tick.entry ? 0 : depth_past_;
  while (tops_.size() < scene_.layers.size() && tick.depth_m >= topOf(tops_.size())) {
    const double share = (topOf(tops_.size()) - depth_before) / (tick.depth_m - depth_before);
    tops_.push_back({x_before + (tick.x_m - x_before) * share, false});
  }
}

// "Axial models", GOD_OBJECT: "−K·(x − x_proxy): the proxy stays on the top of the layer that the tip meets;
// a force above that layer's cutting force lets it through, and it moves with the tip to the next top"
ModelForce ReferenceModel::godObject(const ModelTick& tick) {
  meetTops(tick);
  if (tick.entry) {
    proxy_on_ = 0;
    proxy_last_ = 0;
  }
  ModelForce out;
  while (true) {
    if (!proxy_on_ && proxy_last_ + 1 < tops_.size()) proxy_on_ = ++proxy_last_;
    if (!proxy_on_) return out;
    const double pressed =
        scene_.god_object.stiffness_N_per_m * std::max(0.0, tick.x_m - tops_[*proxy_on_].place_m);
    if (pressed <= scene_.layers[*proxy_on_].cutting_force_N) {
      out.cutting_N = -pressed;
      return out;
    }
    proxy_on_.reset();
  }
}

// x_c of "Puncture", beyond which nothing is cut or rubbed
double ReferenceModel::openTo(double x_m) const {
  double x_c = x_m;
  for (const Top& top : tops_)
    if (!top.through) x_c = std::min(x_c, top.place_m);
  return x_c;
}

// a top holds with its force at z until that reaches the puncture force; applies to tops that hold together
template <class Force, class Most>
double ReferenceModel::heldByTops(double x_m, const Force& force_N, const Most& max_N) {
  double held_N = 0;
  for (std::size_t i = 0; i < tops_.size(); ++i) {
    const double z = x_m - tops_[i].place_m;
    if (tops_[i].through || z <= 0) continue;
    const double pressed_N = force_N(scene_.layers[i], z);
    if (pressed_N >= max_N(scene_.layers[i]))
      tops_[i].through = true;
    else
      held_N -= pressed_N;
  }
  return held_N;
}

// constant cutting by a dragged wall in the layer that the tip cuts: the one above the first holding top
template <class Cutting>
double ReferenceModel::cutTo(double x_c, double depth_m, const Cutting& cutting_N) {
  double cutting = 0;
  for (std::size_t i = 0; i < tops_.size() && tops_[i].through && i <= layerAt(depth_m); ++i)
    cutting = cutting_N(scene_.layers[i]);
  const double K_t = scene_.tracking_wall.stiffness_N_per_m;
  wall_ = std::min(std::max(wall_, x_c - cutting / K_t), x_c);
  return -K_t * (x_c - wall_);
}

// "Axial models", FIRST_ORDER: "in each layer a linear stiffness up to its puncture force; then constant
// cutting, and friction per inserted length by a dragged wall"
ModelForce ReferenceModel::firstOrder(const ModelTick& tick) {
  meetTops(tick);
  const double held_at = openTo(tick.x_m);
  ModelForce out;
  out.puncture_N = heldByTops(
      tick.x_m, [](const LayerSpec& layer, double z) { return layer.first_order->stiffness_N_per_m * z; },
      [](const LayerSpec& layer) { return layer.first_order->puncture_force_N; });
  const double x_c = openTo(tick.x_m);
  wall_ += x_c - held_at;
  friction_wall_ += x_c - held_at;
  out.cutting_N =
      cutTo(x_c, tick.depth_m, [](const LayerSpec& layer) { return layer.first_order->cutting_force_N; });
  const double K_f = scene_.friction_stiffness_N_per_m;
  const double length = std::min(tick.insertion_m, std::max(0.0, x_c));
  const double reach = tick.layers->integral(length, [](const LayerSpec& layer) {
    return layer.first_order->friction_N_per_m;
  }) / K_f;
  friction_wall_ = std::min(std::max(friction_wall_, x_c - reach), x_c + reach);
  out.friction_N = -K_f * (x_c - friction_wall_);
  return out;
}

// "Axial models", OKAMURA: Karnopp's maximum friction. At rest static; in motion kinetic and viscous, plus
// the excess of static friction at the speed where motion begins, minus K_f times the distance since
double ReferenceModel::karnopp(const ModelTick& tick, double slid_m, double kinetic_N, double static_N,
                               double viscous_N_per_mps) const {
  const double speed = std::abs(tick.speed_mps), rest = scene_.tracking_wall.stop_speed_mps;
  if (speed < rest) return std::max(static_N, kinetic_N + viscous_N_per_mps * speed);
  const double left =
      static_N - kinetic_N - viscous_N_per_mps * rest - scene_.friction_stiffness_N_per_m * slid_m;
  return kinetic_N + viscous_N_per_mps * speed + std::max(0.0, left);
}

// "Axial models", OKAMURA and DAHL: in each layer a quadratic stiffness up to its puncture force; then
// constant cutting, and friction of the inserted length by a spring that follows x_c
ModelForce ReferenceModel::threeForces(const ModelTick& tick) {
  const double came_from = openTo(tick.entry ? 0 : x_past_ + tick.moved_m);
  meetTops(tick);
  const double held_at = openTo(tick.x_m), way = held_at - came_from;
  ModelForce out;
  out.puncture_N = heldByTops(
      tick.x_m,
      [](const LayerSpec& layer, double z) {
        return layer.okamura->linear_N_per_m * z + layer.okamura->quadratic_N_per_m2 * z * z;
      },
      [](const LayerSpec& layer) { return layer.okamura->puncture_force_N; });
  const double x_c = openTo(tick.x_m);
  wall_ += x_c - held_at;
  out.cutting_N =
      cutTo(x_c, tick.depth_m, [](const LayerSpec& layer) { return layer.okamura->cutting_force_N; });

  const double K_f = scene_.friction_stiffness_N_per_m;
  const double length = std::min(tick.insertion_m, std::max(0.0, x_c));
  const auto over = [&](ShaftFrictionSpec OkamuraSpec::*side, double ShaftFrictionSpec::*number) {
    return tick.layers->integral(length,
                                 [&](const LayerSpec& layer) { return (*layer.okamura).*side.*number; });
  };
  using Side = ShaftFrictionSpec;
  const double speed = std::abs(tick.speed_mps);
  if (scene_.axial_model == AxialModel::kOkamura) {
    slid_ = speed < scene_.tracking_wall.stop_speed_mps ? 0 : slid_ + std::abs(way);
    const auto most = [&](ShaftFrictionSpec OkamuraSpec::*side) {
      return karnopp(tick, slid_, over(side, &Side::kinetic_N_per_m), over(side, &Side::static_N_per_m),
                     over(side, &Side::viscous_Ns_per_m2)) /
             K_f;
    };
    spring_ = std::min(std::max(spring_ + way, -most(&OkamuraSpec::out)), most(&OkamuraSpec::in));
  } else {
    const auto most = [&](ShaftFrictionSpec OkamuraSpec::*side) {
      return (over(side, &Side::kinetic_N_per_m) + over(side, &Side::viscous_Ns_per_m2) * speed) / K_f;
    };
    const double in = most(&OkamuraSpec::in), outward = most(&OkamuraSpec::out);
    // dz/dx = 1 − sign(dx) z/reach, with the reach on z's side: two exponentials, separated at z = 0
    double left = std::abs(way);
    const double sign = way < 0 ? -1 : 1, ahead = way < 0 ? outward : in, behind = way < 0 ? in : outward;
    double z = sign * spring_;
    if (left > 0 && z < 0) {
      const double to_zero = behind > 0 ? behind * std::log1p(-z / behind) : 0;
      if (left < to_zero) {
        z = behind - (behind - z) * std::exp(-left / behind);
        left = 0;
      } else {
        left -= to_zero;
        z = 0;
      }
    }
    if (left > 0) z = ahead > 0 ? ahead + (z - ahead) * std::exp(-left / ahead) : 0;
    spring_ = std::min(std::max(sign * z, -outward), in);
  }
  out.friction_N = -K_f * spring_;
  return out;
}

ModelForce ReferenceModel::step(const ModelTick& tick) {
  if (tick.entry) {
    ++insertion_;
    x_past_ = wall_ = friction_wall_ = 0;
    spring_ = slid_ = 0;
    stop_.emplace(scene_.tracking_wall, rate_hz_, lists(Effect::kCutting) || lists(Effect::kAttracted));
    tops_.clear();
  }
  // "w, the friction wall, the places of membranes and the remembered values of x … move by x_new − x_old"
  wall_ += tick.moved_m;
  friction_wall_ += tick.moved_m;
  if (tick.entry) wall_ = friction_wall_ = tick.x_m - std::max(0.0, std::min(tick.x_m, tick.entry_way_m));
  stop_->move(tick.moved_m);
  for (Top& top : tops_) top.place_m += tick.moved_m;

  const double K_t = scene_.tracking_wall.stiffness_N_per_m;
  const LayerSpec& layer = scene_.layers[layerAt(tick.depth_m)];
  const double cuts = lists(Effect::kCutting) ? 1 : 0, attracts = lists(Effect::kAttracted) ? 1 : 0;
  ModelForce out;
  switch (scene_.axial_model) {
    case AxialModel::kEnhancedTrackingWall:
      out = wall(tick, cuts * layer.cutting_force_N / K_t, attracts * layer.attracted_force_N / K_t);
      break;
    case AxialModel::kTrackingWall:
      out = wall(tick, cuts * layer.cutting_force_N / K_t, 0);
      break;
    case AxialModel::kStatistical:
      out = wall(tick, cuts * statisticalTarget(tick.depth_m) / K_t, 0);
      break;
    case AxialModel::kPrecomputed: {
      using Row = PrecomputedSpec::Row;
      const auto& table = scene_.precomputed.table;
      out = wall(tick, cuts * tableAt(table, &Row::cutting_N, 1, tick.depth_m) / K_t,
                 attracts * tableAt(table, &Row::attracted_N, 1, tick.depth_m) / K_t);
      break;
    }
    case AxialModel::kDirect:
      if (cuts > 0) out = direct(tick);
      break;
    case AxialModel::kVoigt:
      if (cuts > 0) out = voigt(tick);
      break;
    case AxialModel::kGodObject:
      if (cuts > 0) out = godObject(tick);
      break;
    case AxialModel::kFirstOrder:
      if (cuts > 0) out = firstOrder(tick);
      break;
    case AxialModel::kOkamura:
    case AxialModel::kDahl:
      if (cuts > 0) out = threeForces(tick);
      break;
    case AxialModel::kFem:
      break;
  }
  x_past_ = tick.x_m;
  depth_past_ = tick.depth_m;
  return out;
}

}  // namespace needlelab::test
