#include "server/grid/grid_meta.h"

#include <utility>

#include "proto/container/distance_unit.h"
#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld {

using nlohmann::json;

namespace {

constexpr const char* kBandVoxels = "band_voxels";

// The member if it is there and of the type of `absent`.
template <typename T>
T member(const json& object, const char* name, T absent) {
  const auto found = object.find(name);
  if (found == object.end() || found->type() != json(absent).type()) return absent;
  return found->get<T>();
}

bool has_fill(const json& members, Fill fill) {
  const auto options = members.find("options");
  return options != members.end() && options->is_object() &&
         member(*options, "fill", std::string()) ==
             option_values::word_of<Fill>(fill, option_words::kFill);
}

}  // namespace

GridMeta::GridMeta() : GridMeta(json::object()) {}

GridMeta::GridMeta(json members)
    : members_(std::make_shared<const json>(members.is_object() ? std::move(members)
                                                                : json::object())) {}

GridMeta GridMeta::parse(std::string_view text) {
  return GridMeta(json::parse(text, nullptr, /*allow_exceptions=*/false));
}

std::string GridMeta::text() const {
  return members_->dump(-1, ' ', false, json::error_handler_t::replace);
}

GridMeta GridMeta::with(const json& more) const {
  json members = *members_;
  if (more.is_object()) members.update(more);
  return GridMeta(std::move(members));
}

std::string GridMeta::content_hash() const {
  return member(*members_, "content_hash", std::string());
}

int GridMeta::algorithm_version() const {
  const auto found = members_->find("algorithm_version");
  return found != members_->end() && found->is_number_integer() ? found->get<int>() : 0;
}

bool GridMeta::is_band() const {
  return has_fill(*members_, Fill::kBand);
}

bool GridMeta::is_solid() const {
  return has_fill(*members_, Fill::kSolid);
}

double GridMeta::band_voxels() const {
  constexpr double kLeast = 1;  // of the option
  if (const auto own = members_->find(kBandVoxels); own != members_->end() && own->is_number()) {
    return own->get<double>();
  }
  if (!is_band()) return 0;
  const json& options = members_->at("options");
  const auto thickness = options.find("thickness");
  return thickness != options.end() && thickness->is_number() ? thickness->get<double>() : kLeast;
}

GridMeta GridMeta::with_band_voxels(double thickness) const {
  return with({{kBandVoxels, thickness}});
}

bool GridMeta::has_world_distances() const {
  return voxeld::has_world_distances(*members_);
}

}  // namespace voxeld
