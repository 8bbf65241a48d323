// VTK (libvtk9-dev): vtkPolyDataToImageStencil, which takes the voxels whose centres are inside a
// closed surface, slice by slice, and the image that the stencil makes.
#include <algorithm>

#include <vtkCellArray.h>
#include <vtkImageData.h>
#include <vtkImageStencilToImage.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataToImageStencil.h>

#include "tests/bench/rival.h"

namespace voxeld::bench {
namespace {

uint64_t solid(const GridMesh& mesh) {
  vtkNew<vtkPoints> points;
  points->SetNumberOfPoints(static_cast<vtkIdType>(mesh.positions.size() / 3));
  for (size_t i = 0; i < mesh.positions.size(); i += 3) {
    points->SetPoint(static_cast<vtkIdType>(i / 3), &mesh.positions[i]);
  }
  vtkNew<vtkCellArray> triangles;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const vtkIdType corners[3] = {mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]};
    triangles->InsertNextCell(3, corners);
  }
  vtkNew<vtkPolyData> surface;
  surface->SetPoints(points);
  surface->SetPolys(triangles);
  vtkNew<vtkPolyDataToImageStencil> stencil;
  stencil->SetInputData(surface);
  stencil->SetOutputOrigin(0.5, 0.5, 0.5);
  stencil->SetOutputSpacing(1, 1, 1);
  stencil->SetOutputWholeExtent(0, mesh.size - 1, 0, mesh.size - 1, 0, mesh.size - 1);
  vtkNew<vtkImageStencilToImage> image;
  image->SetInputConnection(stencil->GetOutputPort());
  image->SetInsideValue(1);
  image->SetOutsideValue(0);
  image->SetOutputScalarTypeToUnsignedChar();
  image->Update();
  const auto* cells = static_cast<const uint8_t*>(image->GetOutput()->GetScalarPointer());
  const auto side = static_cast<ptrdiff_t>(mesh.size);
  return static_cast<uint64_t>(std::count(cells, cells + side * side * side, 1));
}

}  // namespace

Rival vtk_rival() {
  return {.name = "vtk", .solid = solid};
}

}  // namespace voxeld::bench
