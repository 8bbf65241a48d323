"""The meshes of the tables: made ones, and real ones where a data folder is given."""
import dataclasses
import pathlib
import shutil
import zipfile

from .programs import Skipped

SPOT_MATERIAL = "newmtl spot\nKd 1 1 1\nmap_Kd spot_texture.png\n"


@dataclasses.dataclass
class Scene:
    key: str
    title: str
    source: str  # of the programs in tests/bench: a path or a made mesh
    file: str = ""  # of the same mesh as an upload
    ply: str = ""  # of the same triangles
    colored: bool = False
    skipped: str = ""  # why it is not there


def made(programs, key, title, source):
    """A mesh that bench_scene.h makes, or closes, written down for programs that read files."""
    scene = Scene(key, title, source)
    scene.ply = scene.file = str(programs.scratch / f"{key}.ply")
    programs.run("write_mesh", source, scene.ply)
    return scene


def from_file(programs, key, title, path):
    if not path.exists():
        raise Skipped(f"no {path.name} in the data folder")
    scene = Scene(key, title, str(path), str(path), str(path))
    if path.suffix != ".ply":
        scene.ply = str(programs.scratch / f"{key}.ply")
        programs.run("write_mesh", path, scene.ply)
    return scene


def dragon(programs, key, title, path):
    """The full dragon, stored by Draco."""
    if not path.exists():
        raise Skipped(f"no {path.name} in the data folder")
    decoder = shutil.which("draco_decoder")
    if decoder is None:
        raise Skipped("no draco_decoder (Debian package draco)")
    ply = programs.scratch / f"{key}.ply"
    programs.run(decoder, "-i", path, "-o", ply)
    return from_file(programs, key, title, ply)


def spot(programs, key, title, path):
    """The mesh names no material: an upload with one of its own gives it the texture."""
    texture = path.with_name("spot_texture.png")
    if not path.exists() or not texture.exists():
        raise Skipped(f"no {path.name} with {texture.name} in the data folder")
    bundle = programs.scratch / f"{key}.zip"
    with zipfile.ZipFile(bundle, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("spot.obj", "mtllib spot.mtl\nusemtl spot\n" + path.read_text())
        archive.writestr("spot.mtl", SPOT_MATERIAL)
        archive.write(texture, texture.name)
    scene = from_file(programs, key, title, bundle)
    scene.colored = True
    return scene


def with_data(data, make, relative):
    def scene(programs, key, title):
        if data is None:
            raise Skipped("no data folder (--data DIR or VOXELD_DATA_DIR)")
        return make(programs, key, title, pathlib.Path(data) / relative)
    return scene


def with_source(source):
    return lambda programs, key, title: made(programs, key, title, source)


def closed_bunny(data):
    def scene(programs, key, title):
        file = with_data(data, from_file, "scans/bunny/bun_zipper.ply")(programs, key, title)
        return made(programs, key, title, f"closed:{file.source}")
    return scene


def table(data, quick):
    """key: (title, how it is made). Those of `solid` tables are closed."""
    if quick:
        return {"wave": ("waves, 20 k", with_source("wave:20000")),
                "closed": ("closed waves, 5 k", with_source("waves-4"))}
    return {
        "bunny": ("bunny, 69 k", with_data(data, from_file, "scans/bunny/bun_zipper.ply")),
        "buddha": ("Buddha, 100 k", with_data(data, from_file, "scans/buddha/buddha_100k.obj")),
        "dragon": ("dragon, 871 k", with_data(data, dragon, "scans/dragon/dragon_full.drc")),
        "wave": ("waves, 1.1 M", with_source("wave:1100000")),
        "spot": ("spot, 6 k, textured", with_data(data, spot, "obj/spot/spot_triangulated.obj")),
        "bob": ("Bob, animated", with_data(data, from_file, "md5/bob/Bob.md5mesh")),
        "closed": ("closed waves, 82 k", with_source("waves-6")),
        "closed_bunny": ("bunny with its holes closed", closed_bunny(data)),
    }


def prepare(programs, data, quick, wanted):
    """The scenes of those names (all where empty), those that cannot be made with the reason."""
    scenes = {}
    for key, (title, make) in table(data, quick).items():
        if wanted and key not in wanted:
            continue
        try:
            scenes[key] = make(programs, key, title)
        except Skipped as reason:
            scenes[key] = Scene(key, title, "", skipped=str(reason))
    return scenes
