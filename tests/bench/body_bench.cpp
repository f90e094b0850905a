// A body's picture: what the accuracy of its surfaces costs, the time from a profile to its first picture,
// and frames a second while it turns, at 1280×720 with software rendering. With --pictures it writes the
// pictures to look at.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "client/view/model/body_view.h"
#include "client/view/scene/scene_renderer.h"
#include "client/view/surface.h"
#include "client/view/theme.h"
#include "common/anatomy/field_body.h"
#include "common/anatomy/surface_nets.h"
#include "common/base/time/clock.h"
#include "common/profile/profile.h"

namespace needlelab::test {
namespace {

constexpr int kWidth = 1280, kHeight = 720, kFrames = 60;

double cpuNow_ms() {  // of all threads: llvmpipe's, too
  std::timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

// ---- what the accuracy of surfaces costs ----

void measureSurface(const SceneView& scene, const char* what, StructureMask mask, double cell_m) {
  const Field& field = scene.body->field();
  const double reach_m = bodyReach_m(scene);
  const Vec3 middle_m = inverse(scene.X_WL) * scene.focus_W_m, half{reach_m, reach_m, reach_m};
  const NetOptions options{.cell_m = cell_m, .within = {middle_m - half, middle_m + half}};
  SurfaceMesh mesh;
  std::vector<double> ms;
  for (int i = 0; i < 5; ++i) {
    const double began_ms = cpuNow_ms();
    mesh = surfaceNet(field, mask, options);
    ms.push_back(cpuNow_ms() - began_ms);
  }
  std::vector<double> vertices_mm, middles_mm;
  for (const SurfaceMesh::Vertex& vertex : mesh.vertices)
    vertices_mm.push_back(1e3 * std::fabs(field.structuresDistance(mask, vertex.p_m)));
  for (const auto& [a, b, c] : mesh.triangles)
    middles_mm.push_back(
        1e3 * std::fabs(field.structuresDistance(
                  mask, (mesh.vertices[a].p_m + mesh.vertices[b].p_m + mesh.vertices[c].p_m) / 3)));
  std::printf("| %s | %.1f | %zu | %.0f | %.4f, %.3f | %.3f, %.2f |\n", what, cell_m * 1e3,
              mesh.triangles.size(), quantile(ms, 0.5), quantile(vertices_mm, 0.5),
              quantile(vertices_mm, 0.99), quantile(middles_mm, 0.5), quantile(middles_mm, 0.99));
}

void measureSurfaces(const SceneView& scene) {
  StructureMask bones = 0;
  for (std::size_t i = 0; i < scene.layers.size(); ++i)
    if (structureKind(scene.layers[i].kind).shape == StructureShape::kBone)
      bones |= maskOf(static_cast<StructureIndex>(i));
  std::printf(
      "| surface | cell mm | triangles | ms | vertices off mm p50, p99 | triangles' middles off mm p50, p99 |\n"
      "|---|---:|---:|---:|---:|---:|\n");
  for (const double cell_mm : {6.0, 4.0, 3.0, 2.0, 1.5, 1.0})
    measureSurface(scene, "skin", kWholeBody, cell_mm * 1e-3);
  for (const double cell_mm : {4.0, 3.0, 2.0, 1.5, 1.0})
    measureSurface(scene, "bones", bones, cell_mm * 1e-3);
}

// ---- pictures and frames ----

struct Stage {
  std::shared_ptr<const SceneView> scene;
  SceneRenderer& renderer;
  SceneFrame frame;

  Stage(std::shared_ptr<const SceneView> shown, SceneRenderer& by) : scene(std::move(shown)), renderer(by) {
    frame.camera = initialView(*scene);
    frame.aids = allAidSet();
    frame.aids.set(pb::Exercise::ARROWS, false);
  }
  /// The needle on the way from the focus to the first target, a little aslant; `in_m` < 0: before the skin.
  void place(double in_m) {
    const Vec3 out = scene->focus_normal_W;
    Vec3 axis = scene->targets.empty() ? -out : scene->targets.front().center_W_m - scene->focus_W_m;
    axis = norm(axis) > 1e-3 && dot(axis, out) < 0 ? normalized(axis) : -out;
    const double w = 1 + axis.z;
    Moment& moment = frame.moment;
    moment.q_WT = w > 1e-9 ? normalized(Quat{-axis.y, axis.x, 0, w}) : Quat{1, 0, 0, 0};
    moment.p_WT_m = scene->focus_W_m + axis * in_m;
    moment.inside = in_m > 0;
    moment.p_entry_W_m = scene->focus_W_m;
    moment.u_W = axis;
    moment.alpha_rad = 0.2;
    const double none = std::numeric_limits<double>::quiet_NaN();
    moment.wall_W_m = {none, none, none};
  }
  [[nodiscard]] double toTarget_m() const {
    return scene->targets.empty() ? 0.02 : norm(scene->targets.front().center_W_m - scene->focus_W_m);
  }
  /// The second time at rest, with all its samples.
  void draw() {
    for (int i = 0; i < 2; ++i) renderer.draw(frame, kWidth, kHeight);
  }
};

Status writePictures(Stage& stage, Surface& surface, const std::filesystem::path& folder,
                     const std::string& name) {
  const auto save = [&](const char* view) {
    stage.draw();
    return savePng(stage.renderer.picture(), folder / (name + "_" + view + ".png"));
  };
  const double deep_m = stage.toTarget_m();
  stage.place(-0.01);
  RETURN_IF_ERROR(save("cut"));
  stage.place(deep_m);
  RETURN_IF_ERROR(save("cut_in"));
  stage.frame.camera.azimuth_rad -= 1.3;
  stage.frame.camera.elevation_rad = 0.4;
  RETURN_IF_ERROR(save("cut_turned"));
  stage.frame.camera = initialView(*stage.scene);
  stage.frame.cut_open = false;
  RETURN_IF_ERROR(save("glass"));
  stage.frame.aids.set(pb::Exercise::TISSUES, false);
  stage.frame.aids.set(pb::Exercise::ANATOMY, false);
  stage.frame.camera = viewOfWhole(*stage.scene);
  stage.frame.show_hand = false;
  RETURN_IF_ERROR(save("closed"));
  // the widget, with names
  stage.frame = Stage(stage.scene, stage.renderer).frame;
  stage.place(deep_m);
  for (int i = 0; i < 4 && surface.beginFrame(); ++i) {
    beginScreen("body");
    sceneWidget("scene", stage.renderer, stage.frame, {0, 0});
    endScreen();
    surface.endFrame();
  }
  return savePng(surface.picture(), folder / (name + "_names.png"));
}

void measureFrames(Stage& stage) {
  struct Mode {
    const char* name;
    bool open, tissues;
  };
  std::printf(
      "\n| frames of 1280×720 | turning ms p50, p99 | needle moving ms p50, p99 |\n|---|---:|---:|\n");
  for (const Mode mode :
       {Mode{"cut open", true, true}, {"skin as glass", false, true}, {"closed", false, false}}) {
    stage.frame = Stage(stage.scene, stage.renderer).frame;
    stage.frame.cut_open = mode.open;
    stage.frame.aids.set(pb::Exercise::TISSUES, mode.tissues);
    stage.place(stage.toTarget_m());
    const auto timed = [&](const std::function<void(int)>& change) {
      std::vector<double> ms;
      for (int i = 0; i < kFrames; ++i) {
        change(i);
        const double began_ms = cpuNow_ms();
        stage.renderer.draw(stage.frame, kWidth, kHeight);
        ms.push_back(cpuNow_ms() - began_ms);
      }
      return std::pair{quantile(ms, 0.5), quantile(ms, 0.99)};
    };
    stage.draw();
    stage.frame.camera.azimuth_rad += 0.02;
    stage.draw();
    const auto turning = timed([&](int) { stage.frame.camera.azimuth_rad += 0.03; });
    stage.draw();
    const auto moving = timed([&](int i) {
      stage.frame.moment.p_WT_m = stage.scene->focus_W_m + stage.frame.moment.u_W * (0.002 + 2e-4 * i);
    });
    std::printf("| %s | %.0f, %.0f | %.0f, %.0f |\n", mode.name, turning.first, turning.second, moving.first,
                moving.second);
  }
}

int run(const std::filesystem::path& file, const std::filesystem::path& pictures) {
  const auto failed = [](const Error& error) {
    std::fprintf(stderr, "body bench: %s\n", error.message.c_str());
    return 2;
  };
  SurfaceOptions options;
  options.kind = SurfaceOptions::Kind::kOffScreen;
  options.width_px = kWidth;
  options.height_px = kHeight;
  options.frames_per_s = 0;
  const auto surface = Surface::open(options);
  if (!surface) return failed(surface.error());
  const auto renderer = SceneRenderer::make(4);
  if (!renderer) return failed(renderer.error());
  (*renderer)->wait_for_pixels = true;

  const double began_cpu_ms = cpuNow_ms(), began_ns = static_cast<double>(steadyNowNs());
  const auto profile = loadProfile(file);
  if (!profile) return failed(profile.error());
  auto view = sceneViewOf(*profile);
  if (!view) return failed(view.error());
  if (!view->body) return failed({ErrorCode::kInvalidInput, file.string() + ": the profile has no volume"});
  const auto scene = std::make_shared<const SceneView>(std::move(view).value());
  (*renderer)->setScene(scene);
  Stage stage(scene, **renderer);
  stage.place(-0.01);
  (*renderer)->draw(stage.frame, kWidth, kHeight);
  std::printf(
      "%s: %.0f ms of processor time from the profile to its first picture (%.0f ms by the clock), %zu "
      "triangles\n\n",
      scene->profile_name.c_str(), cpuNow_ms() - began_cpu_ms,
      (static_cast<double>(steadyNowNs()) - began_ns) * 1e-6, bodyMeshesOf(*scene).triangles());
  measureSurfaces(*scene);
  measureFrames(stage);
  if (pictures.empty()) return 0;
  stage.frame = Stage(scene, **renderer).frame;
  if (const Status written = writePictures(stage, **surface, pictures, scene->profile_id); !written)
    return failed(written.error());
  return 0;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  const bool pictures = argc == 4 && std::strcmp(argv[2], "--pictures") == 0;
  if (argc != 2 && !pictures) {
    std::fprintf(stderr, "usage: needlelab_body_bench PROFILE.json [--pictures FOLDER]\n");
    return 2;
  }
  return needlelab::test::run(argv[1], pictures ? argv[3] : "");
}
