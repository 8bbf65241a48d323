"""A leaf with holes: its voxels' colours, and what alpha=keep|cut leaves of it in grids, formats and images."""
import io
import unittest
import zipfile

import numpy as np
import PIL.Image

from harness import DaemonTest

SIZE = 8
GREEN = (0, 200, 0)


def leaf(mtl):
    """A square. Every other texel is green down to the middle of the fourth row of voxels; the others are
    transparent black."""
    texels = np.zeros((64, 64, 4), np.uint8)
    rows, columns = np.indices((28, 64))
    texels[:28][(rows + columns) % 2 == 0] = (*GREEN, 255)
    png, archive = io.BytesIO(), io.BytesIO()
    PIL.Image.fromarray(texels).save(png, "png")
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("leaf.obj", "mtllib leaf.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                      "vt 0 1\nusemtl skin\nf 1/1 2/2 3/3 4/4\n")
        file.writestr("leaf.mtl", "newmtl skin\n" + mtl)
        file.writestr("leaf.png", png.getvalue())
    return archive.getvalue()


class Transparency(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.post("/v1/assets?filename=leaf.zip", leaf("map_Kd leaf.png\nmap_d leaf.png\n"))
        cls.asset = cls.asset.json()["id"]

    def voxelize(self, **options):
        job = self.daemon.submit(kind="voxelize", asset=self.asset, options={"size": SIZE, **options})
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "done", status)
        return status, self.daemon.get(f"/v1/jobs/{job}/result").body

    def colors(self, **options):
        grid = np.load(io.BytesIO(self.voxelize(format="npz", layout="sparse", **options)[1]))
        return {tuple(cell): tuple(map(int, color)) for cell, color in zip(grid["coords"], grid["color"])}

    def test_colours_are_weighted_by_alpha_and_equal_areas_have_equal_alpha(self):
        colors = self.colors()
        self.assertEqual(len(colors), SIZE * SIZE)
        for (_, y, _), color in colors.items():
            if y < SIZE // 2:
                self.assertEqual(color, (255, 255, 255, 0))
                continue
            np.testing.assert_allclose(color[:3], GREEN, atol=2)
            if y > SIZE // 2:
                self.assertAlmostEqual(color[3], 127.5, delta=4)

    def test_cut_leaves_transparent_voxels_out(self):
        kept = self.colors(alpha="cut")
        self.assertEqual(set(kept), {cell for cell in self.colors() if cell[1] >= SIZE // 2})
        self.assertEqual(set(self.colors(alpha="cut", level=1)),
                         {(x, y, 0) for x in range(SIZE // 2) for y in range(SIZE // 4, SIZE // 2)})

    def test_cut_leaves_nothing_at_the_side_opposite_to_the_leaf(self):
        for size in (48, 64, 80):
            rows = {y for _, y, _ in self.colors(size=size, alpha="cut")}
            self.assertGreaterEqual(min(rows), size * 36 // 64 - 1, size)

    def test_formats_without_alpha_leave_them_out_unless_they_are_asked_for(self):
        def faces(**options):
            return sum(line.startswith(b"f ") for line in
                       self.voxelize(format="obj", mesh="faces", **options)[1].splitlines())
        half, whole = 2 * SIZE * SIZE // 2 + 3 * SIZE, 2 * SIZE * SIZE + 4 * SIZE
        self.assertEqual(faces(), half)
        self.assertEqual(faces(alpha="keep"), whole)
        self.assertEqual(faces(crop="yes"), half)

    def test_a_stored_grid_is_cut_when_it_is_exported(self):
        status, _ = self.voxelize()
        grid = status["result"]["grid"]
        for options, voxels in (("format=npz&layout=sparse", 64), ("format=npz&layout=sparse&alpha=cut", 32)):
            body = self.daemon.get(f"/v1/grids/{grid}?{options}").body
            self.assertEqual(len(np.load(io.BytesIO(body))["coords"]), voxels)
        lines = {options: len(self.daemon.get(f"/v1/grids/{grid}?format=xyz{options}").body.splitlines())
                 for options in ("", "&alpha=keep")}
        self.assertEqual(lines, {"": 32, "&alpha=keep": 64})
        qb = {options: self.daemon.get(f"/v1/grids/{grid}?format=qb{options}").body
              for options in ("", "&alpha=cut", "&alpha=keep")}
        self.assertEqual(qb[""], qb["&alpha=cut"])
        self.assertNotEqual(qb[""], qb["&alpha=keep"])

    def test_images_show_what_is_not_transparent(self):
        status, _ = self.voxelize()
        grid = status["result"]["grid"]
        view = "width=64&height=64&samples=1&azimuth=0&elevation=0&shadow=no&ground=no&background=transparent"
        shown = {}
        for alpha in ("auto", "keep", "cut"):
            for source in (f"/v1/grids/{grid}/render.png?{view}&alpha={alpha}",
                           f"/v1/grids/{grid}/render.png?{view}&alpha={alpha}&region=0,0,0,8,8,1"):
                image = np.asarray(PIL.Image.open(io.BytesIO(self.daemon.get(source).body)))
                shown.setdefault(alpha, []).append(image)
        for image in shown["auto"] + shown["cut"]:
            self.assertFalse((image[..., :3][image[..., 3] > 0].min(axis=-1) > 200).any(), "white is shown")
            self.assertTrue((image[..., 3] > 0).any())
        for image in shown["keep"]:
            self.assertTrue((image[..., :3][image[..., 3] > 0].min(axis=-1) > 200).any(), "white is shown")


if __name__ == "__main__":
    unittest.main()
