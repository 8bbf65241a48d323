// The words that enumerated options take on the wire.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "proto/options/options.h"
#include "proto/options/values.h"

namespace voxeld::option_words {

using option_values::Word;

inline constexpr std::array<Word<UpAxis>, 2> kUp = {{{"y", UpAxis::kY}, {"z", UpAxis::kZ}}};
inline constexpr std::array<Word<Rule>, 4> kRule = {{{"touch", Rule::kTouch},
                                                     {"thin", Rule::kThin},
                                                     {"center", Rule::kCenter},
                                                     {"none", Rule::kNone}}};
inline constexpr std::array<Word<Fill>, 4> kFill = {{{"surface", Fill::kSurface},
                                                     {"solid", Fill::kSolid},
                                                     {"shell", Fill::kShell},
                                                     {"band", Fill::kBand}}};
inline constexpr std::array<Word<Interior>, 2> kInterior = {
    {{"none", Interior::kNone}, {"nearest", Interior::kNearest}}};
inline constexpr std::array<Word<Sign>, 6> kSign = {{{"auto", Sign::kAuto},
                                                     {"parity", Sign::kParity},
                                                     {"nonzero", Sign::kNonzero},
                                                     {"majority", Sign::kMajority},
                                                     {"flood", Sign::kFlood},
                                                     {"winding", Sign::kWinding}}};
inline std::string_view sign_name(Sign sign) {
  return option_values::word_of<Sign>(sign, kSign);
}
inline constexpr std::array<Word<ColorMode>, 6> kColor = {{{"average", ColorMode::kAverage},
                                                           {"nearest", ColorMode::kNearest},
                                                           {"dominant", ColorMode::kDominant},
                                                           {"shaded", ColorMode::kShaded},
                                                           {"axis", ColorMode::kAxis},
                                                           {"none", ColorMode::kNone}}};
inline constexpr std::array<Word<LabelKind>, 4> kLabels = {{{"mesh", LabelKind::kMesh},
                                                            {"node", LabelKind::kNode},
                                                            {"material", LabelKind::kMaterial},
                                                            {"group", LabelKind::kGroup}}};
inline constexpr std::array<Word<DistanceUnit>, 2> kDistance = {
    {{"voxels", DistanceUnit::kVoxels}, {"world", DistanceUnit::kWorld}}};
inline constexpr std::array<Word<PipelineChoice>, 4> kPipeline = {
    {{"auto", PipelineChoice::kAuto},
     {"raster", PipelineChoice::kRaster},
     {"compute", PipelineChoice::kCompute},
     {"cpu", PipelineChoice::kCpu}}};
inline constexpr std::array<Word<Codec>, 2> kCodec = {
    {{"fast", Codec::kFast}, {"small", Codec::kSmall}}};
inline constexpr std::array<Word<ArrayLayout>, 3> kLayout = {{{"dense", ArrayLayout::kDense},
                                                              {"sparse", ArrayLayout::kSparse},
                                                              {"atlas", ArrayLayout::kAtlas}}};
inline constexpr std::array<Word<AxisOrder>, 2> kAxes = {
    {{"zyx", AxisOrder::kZyx}, {"xyz", AxisOrder::kXyz}}};
inline constexpr std::array<Word<DType>, 3> kDType = {
    {{"uint8", DType::kUint8}, {"bool", DType::kBool}, {"float32", DType::kFloat32}}};
inline constexpr std::array<Word<MeshSurface>, 4> kMesh = {
    {{"faces", MeshSurface::kFaces},
     {"greedy", MeshSurface::kGreedy},
     {"smooth", MeshSurface::kSmooth},
     {"instances", MeshSurface::kInstances}}};
inline constexpr std::array<Word<MeshCompression>, 2> kCompress = {
    {{"none", MeshCompression::kNone}, {"meshopt", MeshCompression::kMeshopt}}};
inline constexpr std::array<Word<Dither>, 3> kDither = {
    {{"none", Dither::kNone}, {"bayer", Dither::kBayer}, {"error", Dither::kError}}};
inline constexpr std::array<Word<Projection>, 2> kProjection = {
    {{"perspective", Projection::kPerspective}, {"orthographic", Projection::kOrthographic}}};
inline constexpr std::array<Word<Style>, 5> kStyle = {{{"voxel", Style::kVoxel},
                                                       {"smooth", Style::kSmooth},
                                                       {"clay", Style::kClay},
                                                       {"iso", Style::kIso},
                                                       {"blueprint", Style::kBlueprint}}};
inline constexpr std::array<Word<RendererChoice>, 3> kRenderer = {
    {{"auto", RendererChoice::kAuto}, {"gl", RendererChoice::kGl}, {"cpu", RendererChoice::kCpu}}};
inline constexpr std::array<Word<LevelRule>, 2> kLevelRule = {
    {{"any", LevelRule::kAny}, {"majority", LevelRule::kMajority}}};
inline constexpr std::array<Word<AlphaRule>, 3> kAlpha = {
    {{"auto", AlphaRule::kAuto}, {"keep", AlphaRule::kKeep}, {"cut", AlphaRule::kCut}}};
inline constexpr std::array<Word<ImageKind>, 4> kImage = {{{"png", ImageKind::kPng},
                                                           {"gif", ImageKind::kGif},
                                                           {"apng", ImageKind::kApng},
                                                           {"sheet", ImageKind::kSheet}}};
inline constexpr std::array<Word<RootMotionChoice>, 2> kRootMotion = {
    {{"keep", RootMotionChoice::kKeep}, {"strip", RootMotionChoice::kStrip}}};
inline constexpr std::array<Word<Neighbors>, 3> kNeighbors = {
    {{"6", Neighbors::kFaces}, {"18", Neighbors::kEdges}, {"26", Neighbors::kCorners}}};
inline constexpr std::array<Word<bool>, 2> kYesNo = {{{"yes", true}, {"no", false}}};

}  // namespace voxeld::option_words
