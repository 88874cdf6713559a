/* ITK: a mask of the voxels inside by TriangleMeshToBinaryImageFilter, then its distance transform
   by SignedMaurerDistanceMapImageFilter (Maurer, Qi and Raghavan 2003). */
#include <itkImage.h>
#include <itkMesh.h>
#include <itkMultiThreaderBase.h>
#include <itkSignedMaurerDistanceMapImageFilter.h>
#include <itkTriangleCell.h>
#include <itkTriangleMeshToBinaryImageFilter.h>
#include <itkVersion.h>

#include <algorithm>

#include "peer.h"

namespace
{

using mesh = itk::Mesh<double, 3>;
using mask = itk::Image<unsigned char, 3>;
using image = itk::Image<float, 3>;

mesh::Pointer make_mesh(const sdm_mesh &m)
{
    const auto out = mesh::New();
    for (size_t i = 0; i < m.n_vert; i++) out->SetPoint(i, mesh::PointType(m.vert + 3 * i));
    for (size_t i = 0; i < m.n_tri; i++) {
        mesh::CellAutoPointer cell;
        cell.TakeOwnership(new itk::TriangleCell<mesh::CellType>);
        for (int k = 0; k < 3; k++) cell->SetPointId(k, m.tri[3 * i + static_cast<size_t>(k)]);
        out->SetCell(i, cell);
    }
    return out;
}

peer::map_function prepare(const peer::job &j)
{
    const auto fill = itk::TriangleMeshToBinaryImageFilter<mesh, mask>::New();
    mask::SizeType size;
    for (unsigned i = 0; i < 3; i++) size[i] = static_cast<itk::SizeValueType>(j.grid.n[i]);
    fill->SetInput(make_mesh(j.mesh));
    fill->SetOrigin(mask::PointType(j.grid.origin));
    fill->SetSpacing(mask::SpacingType(j.grid.spacing));
    fill->SetSize(size);
    fill->SetInsideValue(1);
    fill->SetOutsideValue(0);
    fill->Update();
    const mask::Pointer inside = fill->GetOutput();
    return [inside, &j](float *values) {
        const auto distance = itk::SignedMaurerDistanceMapImageFilter<mask, image>::New();
        distance->SetInput(inside);
        distance->SquaredDistanceOff();
        distance->UseImageSpacingOn();
        distance->InsideIsPositiveOff();
        distance->Update();
        // zero at the outermost voxels inside; the surface is half a voxel farther out
        const float half =
            static_cast<float>(0.5 * *std::min_element(j.grid.spacing, j.grid.spacing + 3));
        const float *d = distance->GetOutput()->GetBufferPointer();
        std::transform(d, d + sdm_grid_count(&j.grid), values,
                       [half](float v) { return v - half; });
    };
}

} // namespace

int main(int argc, char **argv)
{
    itk::MultiThreaderBase::SetGlobalMaximumNumberOfThreads(1);
    peer::about a;
    a.version = std::string("ITK ") + itk::Version::GetITKVersion();
    a.note = "TriangleMeshToBinaryImage (prepare), SignedMaurerDistanceMap minus half a voxel: "
             "approximate";
    a.whole = true;
    return peer::run(argc, argv, a, prepare);
}
