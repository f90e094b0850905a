// The Python module `needlelab` over the C interface (common/library): arrays in, arrays out. It holds no
// messages of its own.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstddef>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/library/include/needlelab/needlelab.h"

namespace py = pybind11;

namespace {

// ---- handles of C, and its errors as exceptions

template <auto Destroy>
struct Deleter {
  template <typename T>
  void operator()(T* handle) const {
    Destroy(handle);
  }
};
template <typename T, auto Destroy>
using Handle = std::unique_ptr<T, Deleter<Destroy>>;
using ProfileHandle = Handle<nl_profile, nl_profile_destroy>;
using SceneHandle = Handle<nl_scene, nl_scene_destroy>;
using EngineHandle = Handle<nl_engine, nl_engine_destroy>;
using RecordingHandle = Handle<nl_recording, nl_recording_destroy>;
using ScoresHandle = Handle<nl_scores, nl_scores_destroy>;
using CurvesHandle = Handle<nl_curves, nl_curves_destroy>;

/// Calls a function of C with room for its message; a null or 0 becomes ValueError.
template <typename Function, typename... Arguments>
auto checked(Function function, Arguments... arguments) {
  std::array<char, 2000> error{};
  const auto made = function(arguments..., error.data(), error.size());
  if (!made) throw py::value_error(error.data());
  return made;
}

// ---- structs of C as columns

struct Column {
  const char *name, *format;
  std::size_t offset;
  const char* unit;
};
// name in Python and C, numpy's format, unit
#define COLUMN(type, name, format, unit) \
  { #name, format, offsetof(type, name), unit }
constexpr Column kReportColumns[] = {
    {"force_n", "(3,)f8", offsetof(nl_report, wrench.force_n), "N"},
    {"torque_nm", "(3,)f8", offsetof(nl_report, wrench.torque_nm), "N m"},
    COLUMN(nl_report, wall_m, "(3,)f8", "m"),
    COLUMN(nl_report, depth_m, "f8", "m"),
    COLUMN(nl_report, insertion_m, "f8", "m"),
    COLUMN(nl_report, lateral_error_m, "f8", "m"),
    COLUMN(nl_report, speed_m_s, "f8", "m/s"),
    COLUMN(nl_report, cutting_n, "f8", "N"),
    COLUMN(nl_report, attracted_n, "f8", "N"),
    COLUMN(nl_report, friction_n, "f8", "N"),
    COLUMN(nl_report, puncture_n, "f8", "N"),
    COLUMN(nl_report, clamping_n, "f8", "N"),
    COLUMN(nl_report, hub_n, "f8", "N"),
    COLUMN(nl_report, bone_n, "f8", "N"),
    COLUMN(nl_report, palpation_n, "f8", "N"),
    COLUMN(nl_report, layer, "i4", ""),
    COLUMN(nl_report, phase, "i4", ""),
    COLUMN(nl_report, flags, "u4", ""),
};
constexpr Column kSampleColumns[] = {
    COLUMN(nl_sample, tick, "u8", ""),
    COLUMN(nl_sample, time_ns, "i8", "ns"),
    COLUMN(nl_sample, p_m, "(3,)f8", "m"),
    COLUMN(nl_sample, q, "(4,)f8", ""),
    COLUMN(nl_sample, speed_m_s, "f8", "m/s"),
    COLUMN(nl_sample, force_n, "(3,)f8", "N"),
    COLUMN(nl_sample, torque_nm, "(3,)f8", "N m"),
    COLUMN(nl_sample, wall_m, "(3,)f8", "m"),
    COLUMN(nl_sample, insertion_m, "f8", "m"),
    COLUMN(nl_sample, lateral_error_m, "f8", "m"),
    COLUMN(nl_sample, plunger, "f8", ""),
    COLUMN(nl_sample, device_ns, "i4", "ns"),
    COLUMN(nl_sample, engine_ns, "i4", "ns"),
    COLUMN(nl_sample, flags, "u4", ""),
    COLUMN(nl_sample, buttons, "u4", ""),
    COLUMN(nl_sample, layer, "i1", ""),
    COLUMN(nl_sample, phase, "u1", ""),
    COLUMN(nl_sample, fault, "u1", ""),
};
#undef COLUMN

template <std::size_t N>
py::dtype typeOf(const Column (&columns)[N], std::size_t item_size) {
  py::list names, formats, offsets;
  for (const Column& column : columns) {
    names.append(column.name);
    formats.append(column.format);
    offsets.append(column.offset);
  }
  return py::dtype(names, formats, offsets, static_cast<py::ssize_t>(item_size));
}

// ---- scenes

using Placement = std::optional<std::array<double, 7>>;
using Poses = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::optional<nl_pose> poseOf(const Placement& placement) {
  if (!placement) return std::nullopt;
  const auto& p = *placement;
  return nl_pose{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
}

std::size_t rowsOf(const Poses& poses) {
  if (poses.ndim() != 2 || poses.shape(1) != 7)
    throw py::value_error("poses: expected an array of shape (n, 7): x y z in m, quaternion x y z w");
  return static_cast<std::size_t>(poses.shape(0));
}

/// A callable of Python as a law. What it raises is kept: nothing may be thrown through a tick.
struct PythonLaw {
  py::function function;
  std::exception_ptr raised;

  static double call(const nl_law_input* input, void* user) {
    auto& law = *static_cast<PythonLaw*>(user);
    if (law.raised) return 0;
    try {
      return law.function(input->x_m, input->speed_m_s, input->depth_m, input->insertion_m, input->layer)
          .template cast<double>();
    } catch (...) {
      law.raised = std::current_exception();
      return 0;
    }
  }
};

struct Scene {
  std::shared_ptr<ProfileHandle> profile;
  std::optional<nl_pose> placement;
  std::shared_ptr<SceneHandle> scene;
  std::shared_ptr<PythonLaw> law;  // null: none, or one of C

  [[nodiscard]] const nl_scene* get() const { return scene->get(); }
  /// Runs `ticks`, without Python's lock where no law needs it.
  template <typename Ticks>
  void run(Ticks&& ticks) const {
    if (law) {
      ticks();
      if (law->raised) std::rethrow_exception(std::exchange(law->raised, nullptr));
      return;
    }
    const py::gil_scoped_release free;
    ticks();
  }
};

Scene load(const std::string& profile, double rate_hz, const std::string& model, const Placement& placement) {
  Scene scene;
  const std::size_t first = profile.find_first_not_of(" \t\r\n");
  const bool is_json = first != std::string::npos && profile[first] == '{';
  ProfileHandle read(is_json ? checked(nl_profile_parse, profile.data(), profile.size(), "profile")
                             : checked(nl_profile_read, profile.c_str()));
  if (!model.empty()) checked(nl_profile_set_model, read.get(), model.c_str());
  scene.placement = poseOf(placement);
  const nl_pose* const at = scene.placement ? &*scene.placement : nullptr;
  scene.scene = std::make_shared<SceneHandle>(checked(nl_scene_of_profile, read.get(), rate_hz, at));
  scene.profile = std::make_shared<ProfileHandle>(std::move(read));
  return scene;
}

Scene withLaw(const Scene& scene, const py::object& law, double steepest_n_per_m) {
  Scene other = scene;
  nl_law function = &PythonLaw::call;
  if (py::isinstance<py::int_>(law)) {
    other.law = nullptr;
    function = reinterpret_cast<nl_law>(law.cast<std::uintptr_t>());
  } else {
    other.law = std::make_shared<PythonLaw>(PythonLaw{law.cast<py::function>(), nullptr});
  }
  void* const user = other.law.get();
  other.scene = std::make_shared<SceneHandle>(
      checked(nl_scene_with_law, scene.get(), function, user, steepest_n_per_m));
  return other;
}

py::array run(const Scene& scene, const Poses& poses) {
  const std::size_t n = rowsOf(poses);
  static_assert(sizeof(nl_report) % alignof(nl_report) == 0);
  py::array reports(typeOf(kReportColumns, sizeof(nl_report)), std::vector{static_cast<py::ssize_t>(n)});
  const EngineHandle engine(checked(nl_engine_create, scene.get()));
  auto* const out = static_cast<nl_report*>(reports.mutable_data());
  const double* const rows = poses.data();
  scene.run([&] { nl_run(engine.get(), rows, n, nullptr, out, sizeof *out); });
  return reports;
}

py::array forces(const Scene& scene, const Poses& poses) {
  const std::size_t n = rowsOf(poses);
  py::array_t<double> force({static_cast<py::ssize_t>(n), py::ssize_t{3}});
  const EngineHandle engine(checked(nl_engine_create, scene.get()));
  double* const out = force.mutable_data();
  const double* const rows = poses.data();
  scene.run([&] { nl_run(engine.get(), rows, n, out, nullptr, 0); });
  return force;
}

/// One tick at a time.
struct Engine {
  Scene scene;
  EngineHandle engine;

  explicit Engine(const Scene& of) : scene(of), engine(checked(nl_engine_create, of.get())) {}
  py::tuple step(double x, double y, double z, double qx, double qy, double qz, double qw) {
    const nl_pose tip{{x, y, z}, {qx, qy, qz, qw}};
    nl_wrench wrench;
    scene.run([&] { nl_step(engine.get(), &tip, &wrench); });
    return py::make_tuple(wrench.force_n[0], wrench.force_n[1], wrench.force_n[2]);
  }
  [[nodiscard]] py::object report() const {
    py::array one(typeOf(kReportColumns, sizeof(nl_report)), std::vector{py::ssize_t{1}});
    auto* const out = static_cast<nl_report*>(one.mutable_data());
    out->size = sizeof *out;
    nl_get_report(engine.get(), out);
    return one[py::int_(0)];
  }
  [[nodiscard]] std::unique_ptr<Engine> copy() const {
    auto other = std::make_unique<Engine>(scene);
    nl_engine_copy(other->engine.get(), engine.get());
    return other;
  }
};

// ---- recordings and scores

struct Recording {
  RecordingHandle recording;

  [[nodiscard]] static py::array samples(const py::object& self) {
    std::size_t count = 0;
    const nl_sample* const first = nl_recording_samples(self.cast<Recording&>().recording.get(), &count);
    // a view: the recording lives as long as it
    py::array view(typeOf(kSampleColumns, sizeof(nl_sample)), {static_cast<py::ssize_t>(count)}, {}, first,
                   self);
    view.attr("flags").attr("writeable") = false;
    return view;
  }
  [[nodiscard]] std::vector<std::string> holes() const {
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < nl_recording_hole_count(recording.get()); ++i)
      texts.emplace_back(nl_recording_hole(recording.get(), i));
    return texts;
  }
};

py::list score(const py::array& samples, double rate_hz, const Scene& scene,
               const std::optional<std::string>& exercise) {
  if (samples.ndim() != 1 || samples.itemsize() != sizeof(nl_sample) ||
      samples.strides(0) != sizeof(nl_sample))
    throw py::value_error("samples: expected those of read_recording, or a slice of them without gaps");
  const ScoresHandle scores(
      checked(nl_score, static_cast<const nl_sample*>(samples.data()),
              static_cast<std::size_t>(samples.shape(0)), rate_hz, std::as_const(*scene.profile).get(),
              scene.placement ? &*scene.placement : nullptr, exercise ? exercise->c_str() : nullptr));
  const py::object row = py::module_::import("collections")
                             .attr("namedtuple")("Measure", "name value unit passed incomplete words");
  py::list rows;
  nl_measure one{};
  one.size = sizeof one;
  for (std::size_t i = 0; nl_scores_get(scores.get(), i, &one) != 0; ++i)
    rows.append(row(one.name, one.value, one.unit,
                    one.passed < 0 ? py::object(py::none()) : py::bool_(one.passed != 0), one.incomplete != 0,
                    one.words));
  return rows;
}

py::object parsed(const char* json) {
  return py::module_::import("json").attr("loads")(json);
}

/// Curves are named tuples; their arrays are views that keep the set.
py::tuple readCurves(const std::string& folder, const py::kwargs& options) {
  const auto json = py::module_::import("json").attr("dumps")(options).cast<std::string>();
  auto owned = std::make_unique<CurvesHandle>(checked(nl_curves_read, folder.c_str(), json.c_str()));
  const nl_curves* const set = owned->get();
  const py::capsule keeps(owned.release(), [](void* handle) { delete static_cast<CurvesHandle*>(handle); });
  const auto tuple = py::module_::import("collections").attr("namedtuple");
  const py::object row =
      tuple("Curve", "name specimen needle tissue speed_m_s diameter_m depth_m force_n t_s phase");
  py::list curves;
  nl_curve one{};
  one.size = sizeof one;
  for (std::size_t i = 0; nl_curves_get(set, i, &one) != 0; ++i) {
    const auto view = [&](const auto* first) {
      py::array made(py::dtype::of<std::decay_t<decltype(*first)>>(), {static_cast<py::ssize_t>(one.count)},
                     {}, first, keeps);
      made.attr("flags").attr("writeable") = false;
      return made;
    };
    curves.append(row(one.name, one.specimen, one.needle, one.tissue, one.speed_m_s, one.diameter_m,
                      view(one.depth_m), view(one.force_n), view(one.t_s), view(one.phase)));
  }
  return tuple("Curves", "curves metadata")(curves, parsed(nl_curves_metadata(set)));
}

py::dict units() {
  py::dict all;
  for (const Column& column : kReportColumns) all[column.name] = column.unit;
  for (const Column& column : kSampleColumns) all[column.name] = column.unit;
  return all;
}

}  // namespace

PYBIND11_MODULE(needlelab, module) {
  module.doc() =
      "The force engine of needlelab, recordings and scores. SI units; poses are rows of x y z (m) and a quaternion x y z w.";
  module.attr("__version__") = nl_version();
  module.attr("units") = units();
  module.def(
      "load", &load, py::arg("profile"), py::arg("rate_hz") = 1000.0, py::arg("model") = "",
      py::arg("placement") = py::none(),
      "A patient's profile (path, or JSON) as a scene. model: another axial model. placement: the profile's frame in W.");
  module.def(
      "read_recording",
      [](const std::string& path, bool damaged) {
        return Recording{RecordingHandle(checked(nl_recording_read, path.c_str(), damaged ? 1 : 0))};
      },
      py::arg("path"), py::arg("damaged") = false,
      "Reads a recording; damaged=True reads what is left of it.");
  module.def(
      "score", &score, py::arg("samples"), py::arg("rate_hz"), py::arg("scene"),
      py::arg("exercise") = py::none(),
      "The measures of `needlelab-sim score`, as rows (name, value, unit, passed, incomplete, words). exercise: JSON.");
  module.def(
      "read_curves", &readCurves, py::arg("folder"),
      "Force curves of a folder (FIT.md): `curves`, rows (name, specimen, …, depth_m, force_n, t_s, phase), and "
      "`metadata` with notes. Options: describe, digitised, encoding, force_unit, lines_above, negate, tare.");
  py::class_<Scene>(module, "Scene")
      .def("run", &run, py::arg("poses"),
           "Each tick's report: an array whose columns have names and `units`.")
      .def("forces", &forces, py::arg("poses"), "Only the forces on the hand, (n, 3), in N.")
      .def(
          "engine", [](const Scene& scene) { return std::make_unique<Engine>(scene); },
          "To step one tick at a time.")
      .def(
          "with_law", &withLaw, py::arg("law"), py::arg("steepest_n_per_m") = 1000.0,
          "Another force along the needle: law(x_m, speed_m_s, depth_m, insertion_m, layer) in N, or a C function's address (nl_law).")
      .def(
          "depth_m",
          [](const Scene& scene, const std::array<double, 3>& p_m) {
            return nl_scene_depth_m(scene.get(), p_m.data());
          },
          py::arg("p_m"), "How deep a point is under the skin.")
      .def_property_readonly("rate_hz", [](const Scene& scene) { return nl_scene_rate_hz(scene.get()); })
      .def_property_readonly("needle_length_m",
                             [](const Scene& scene) { return nl_scene_needle_length_m(scene.get()); })
      .def_property_readonly("stiffness_n_per_m",
                             [](const Scene& scene) { return nl_scene_stiffness_n_per_m(scene.get()); });
  py::class_<Engine>(module, "Engine")
      .def("step", &Engine::step, "One tick at x, y, z, qx, qy, qz, qw: the force, in N.")
      .def_property_readonly("report", &Engine::report)
      .def("copy", &Engine::copy, "A snapshot: another engine that continues as this one would.");
  py::class_<Recording>(module, "Recording")
      .def_property_readonly("samples", &Recording::samples,
                             "An array over the recording's memory: its columns are views.")
      .def_property_readonly("rate_hz",
                             [](const Recording& read) { return nl_recording_rate_hz(read.recording.get()); })
      .def_property_readonly(
          "metadata",
          [](const Recording& read) { return parsed(nl_recording_metadata(read.recording.get())); })
      .def_property_readonly("holes", &Recording::holes);
}
