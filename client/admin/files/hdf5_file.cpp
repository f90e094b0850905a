#include "client/admin/files/hdf5_file.h"

#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <type_traits>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/gesture/sample_columns.h"

namespace needlelab {
namespace {

constexpr hsize_t kChunkRows = 8192;

// The library tells noteReason of every failed call, and calls with the id of one that failed fail, too: so
// calls go unchecked, and checked() asks once.

void put(hid_t place, const char* name, hid_t type, const void* value, bool as_data_set = false) {
  const hid_t space = H5Screate(H5S_SCALAR);
  if (as_data_set) {
    const hid_t made = H5Dcreate2(place, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value);
    H5Dclose(made);
  } else {
    const hid_t made = H5Acreate2(place, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(made, type, value);
    H5Aclose(made);
  }
  H5Sclose(space);
}

void putNumber(hid_t place, const char* name, double value) {
  put(place, name, H5T_NATIVE_DOUBLE, &value);
}

/// Of fixed length: other programs have trouble with variable ones.
void putText(hid_t place, const char* name, const std::string& text, bool as_data_set = false) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(1, text.size()));
  H5Tset_cset(type, H5T_CSET_UTF8);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  put(place, name, type, text.c_str(), as_data_set);
  H5Tclose(type);
}

template <typename Value>
hid_t typeOf() {
  if constexpr (std::is_floating_point_v<Value>) return H5T_NATIVE_DOUBLE;
  constexpr bool kSigned = std::is_signed_v<Value>;
  if constexpr (sizeof(Value) == 1) return kSigned ? H5T_NATIVE_INT8 : H5T_NATIVE_UINT8;
  if constexpr (sizeof(Value) == 4) return kSigned ? H5T_NATIVE_INT32 : H5T_NATIVE_UINT32;
  return kSigned ? H5T_NATIVE_INT64 : H5T_NATIVE_UINT64;
}

/// In the column's unit; 0: the double as it was measured.
double resolutionOf(const SampleColumn& column, const Resolution& resolution) {
  if (column.step == nullptr) return column.unit == std::string_view("s") ? 1e-9 : 1;
  const double step = resolution.*column.step;
  return column.unit == std::string_view("ns") ? std::max(1.0, step * 1e9) : step;
}

/// Keeps the innermost reason of the first failed call.
herr_t noteReason(hid_t stack, void* reason) {
  const auto first = [](unsigned depth, const H5E_error2_t* what, void* to) {
    if (depth == 0) *static_cast<std::string*>(to) = what->desc;
    return herr_t{0};
  };
  if (static_cast<std::string*>(reason)->empty()) H5Ewalk2(stack, H5E_WALK_UPWARD, first, reason);
  return 0;
}

}  // namespace

Hdf5File::Hdf5File(std::filesystem::path name, const std::string& file, nlohmann::ordered_json session)
    : name_(std::move(name)) {
  H5dont_atexit();  // after a full disk it would try to write again
  H5Eset_auto2(H5E_DEFAULT, noteReason, &reason_);
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  H5Pset_file_locking(access, false, true);  // network file systems refuse locks
  file_ = H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  H5Pclose(access);
  putText(file_, "format", "needlelab-session");
  putNumber(file_, "format_version", 1);
  putText(file_, "program", "needlelab " + programVersion());
  putText(file_, "frame", "W: right-handed, base of the device");
  putText(file_, "quaternion_order", "x y z w");
  if (session.contains("rate_hz")) putNumber(file_, "rate_hz", session["rate_hz"]);
  if (session.contains("hash") && session["hash"].is_string()) putText(file_, "hash", session["hash"]);
  const auto put_json = [&](const char* name, const nlohmann::ordered_json& value) {
    putText(file_, name, value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace), true);
  };
  for (const char* part : {"profile", "score"}) {
    if (session.contains(part)) put_json(part, session[part]);
    session.erase(part);
  }
  put_json("session", session);
}

Hdf5File::~Hdf5File() {
  if (file_ >= 0) H5Fclose(file_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

void Hdf5File::makeColumns(const Resolution& resolution) {
  const hid_t group = H5Gcreate2(file_, "samples", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  const hsize_t empty = 0, unlimited = H5S_UNLIMITED;
  const hid_t space = H5Screate_simple(1, &empty, &unlimited);
  const hid_t form = H5Pcreate(H5P_DATASET_CREATE), access = H5Pcreate(H5P_DATASET_ACCESS);
  H5Pset_chunk(form, 1, &kChunkRows);
  H5Pset_shuffle(form);
  H5Pset_deflate(form, 1);
  H5Pset_chunk_cache(access, 0, 0, 1);
  const GestureSample none;
  forEachSampleColumn(none, 0, [&]<typename Value>(const SampleColumn& column, Value) {
    // 24 bits hold every standard step, over more than a device's reach
    const bool as_float = std::is_floating_point_v<Value> && column.step != nullptr &&
                          resolution.*column.step >= Resolution::standard().*column.step;
    const hid_t type = typeOf<Value>(), stored = as_float ? H5T_NATIVE_FLOAT : type;
    const hid_t set = H5Dcreate2(group, column.name, stored, space, H5P_DEFAULT, form, access);
    putText(set, "units", column.unit);
    putText(set, "description", column.description);
    putNumber(set, "resolution", resolutionOf(column, resolution));
    if (column.inFrame()) putText(set, "frame", "W");
    columns_.push_back({set, type, {}});
  });
  H5Pclose(form);
  H5Pclose(access);
  H5Sclose(space);
}

Status Hdf5File::add(std::span<const GestureSample> samples, std::int64_t first_time_ns,
                     const Resolution& resolution) {
  if (columns_.empty()) makeColumns(resolution);
  for (const GestureSample& sample : samples) {
    auto column = columns_.begin();
    forEachSampleColumn(sample, first_time_ns, [&](const SampleColumn&, auto value) {
      column++->rows.append(reinterpret_cast<const char*>(&value), sizeof value);
    });
    if (++waiting_ == kChunkRows) write();
  }
  return checked();
}

void Hdf5File::write() {
  const hsize_t begin = written_, count = std::exchange(waiting_, 0), end = begin + count;
  const hid_t rows = H5Screate_simple(1, &count, nullptr);
  for (Column& column : columns_) {
    H5Dset_extent(column.set, &end);
    const hid_t place = H5Dget_space(column.set);
    H5Sselect_hyperslab(place, H5S_SELECT_SET, &begin, nullptr, &count, nullptr);
    H5Dwrite(column.set, column.type, rows, place, H5P_DEFAULT, column.rows.data());
    H5Sclose(place);
    column.rows.clear();
  }
  H5Sclose(rows);
  written_ = end;
}

Status Hdf5File::close() {
  if (columns_.empty()) makeColumns({});
  if (waiting_ > 0) write();
  H5Fclose(std::exchange(file_, -1));
  return checked();
}

Status Hdf5File::checked() const {
  if (reason_.empty()) return {};
  // such a reason also has addresses in memory; the number in it says enough
  const auto at = reason_.find("errno = ");
  if (at == std::string::npos)
    return Error{ErrorCode::kFailed, name_.string() + ": cannot write: " + reason_};
  errno = std::atoi(reason_.c_str() + at + 8);
  return systemError(name_, "write");
}

}  // namespace needlelab
