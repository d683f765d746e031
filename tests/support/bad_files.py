"""Broken files, made in code: `CASES` has a maker for each by name, which writes into a folder and returns the path."""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from bad_file_makers import (
    FILES,
    INDICES,
    POSITIONS,
    TRIANGLE,
    UV,
    bmp,
    document,
    glb,
    gltf,
    huge_png,
    image_file,
    outside,
    ply,
    png,
    scene_file,
    text_file,
    zipped,
)


def tree(width: int, depth: int) -> list[dict[str, Any]]:
    """Nodes of which each has the next as a child, `width` times: width^depth places of one mesh."""
    return [{"children": [index + 1] * width} for index in range(depth)] + [{"mesh": 0}]


def shared(depth: int) -> list[dict[str, Any]]:
    """A ladder: each step's two nodes have both nodes of the next step as children, so ways double with each."""
    nodes: list[dict[str, Any]] = []
    for step in range(depth):
        nodes += [{"children": [2 * step + 2, 2 * step + 3]}] * 2
    return [*nodes, {"mesh": 0}, {"mesh": 0}]


def crowd(made: dict[str, Any]) -> None:
    """Many nodes that place one large mesh."""
    made["nodes"] = [{"mesh": 0}] * 4000
    made["scenes"] = [{"nodes": list(range(4000))}]
    made["accessors"][1]["count"] = 60000
    made["bufferViews"][1]["byteLength"] = 120000
    made["buffers"][0]["byteLength"] = 120036


def copies(made: dict[str, Any]) -> None:
    """Many meshes out of one large buffer."""
    made["meshes"] *= 4000
    made["nodes"] = [{"mesh": index} for index in range(4000)]
    made["accessors"][0] |= {"count": 30000}
    made["bufferViews"][0] |= {"byteLength": 360000}
    made["bufferViews"][1] |= {"byteOffset": 360000}
    made["buffers"][0]["byteLength"] = 360008


def patched(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    """Puts `value` at a path such as accessors.0.count."""

    def change(made: dict[str, Any]) -> None:
        *keys, last = [int(key) if key.isdigit() else key for key in path.split(".")]
        at: Any = made
        for key in keys:
            at = at[key]
        at[last] = value

    return change


def add_gltf() -> None:
    sound = glb(document())
    for size in (0, 3, 11, 12, 19, 40, len(sound) - 30, len(sound) - 1):
        text_file(f"GLB cut after {size} bytes", sound[:size], file="m.glb")
    text_file("GLB whose chunk says 4 GiB", sound[:12] + b"\xff\xff\xff\xff" + sound[16:], file="m.glb")
    text_file("GLB of version 1", sound[:4] + b"\1\0\0\0" + sound[8:], file="m.glb")
    text_file("GLB with JSON nested 100000 deep", glb(b"[" * 100000 + b"]" * 100000), file="m.glb")
    text_file("GLB with names that are not UTF-8", glb(b'{"asset": {"version": "2.0\xff\xfe"}}'), file="m.glb")
    text_file("glTF that is a list", "[1, 2]", file="m.gltf")
    text_file("glTF with a number of 5000 digits", '{"asset": ' + "9" * 5000 + "}", file="m.gltf")
    for path, value in (
        ("accessors.0.count", 4),
        ("accessors.0.count", 10**9),
        ("accessors.0.count", 10**30),
        ("accessors.0.count", -3),
        ("accessors.0.count", 1.5),
        ("accessors.0.count", "3"),
        ("accessors.0.byteOffset", 30),
        ("accessors.0.byteOffset", -12),
        ("accessors.0.bufferView", 9),
        ("accessors.0.bufferView", -1),
        ("accessors.0.componentType", 7),
        ("accessors.0.type", "MAT9"),
        ("accessors.0.type", "SCALAR"),
        ("accessors.1.count", 2),
        ("bufferViews.0.byteLength", 10**9),
        ("bufferViews.0.byteLength", -1),
        ("bufferViews.0.byteOffset", 10**9),
        ("bufferViews.0.byteStride", 0),
        ("bufferViews.0.byteStride", -12),
        ("bufferViews.0.byteStride", 10**9),
        ("bufferViews.0.buffer", 3),
        ("buffers.0.byteLength", 10**12),
        ("buffers.0.byteLength", "all"),
        ("meshes.0.primitives.0.attributes.POSITION", 5),
        ("meshes.0.primitives.0.indices", -1),
        ("meshes.0.primitives.0.material", 2),
        ("nodes.0.mesh", 4),
        ("nodes.0.children", [0]),
        ("nodes.0.children", [7]),
        ("nodes.0.matrix", [1, 2, 3]),
        ("nodes.0.matrix", [float("nan")] * 16),
        ("nodes.0.scale", [1e300, 1e300, 1e300]),
        ("nodes.0.rotation", [0, 0, 0, 0]),
        ("scenes.0.nodes", [0, 0]),
        ("scenes.0.nodes", "all"),
    ):
        shown = json.dumps(value)
        gltf(f"glTF {path} = {shown[:40]}", patched(path, value))
    gltf("glTF indices out of range", lambda made: None, POSITIONS + np.array([0, 1, 9, 0], np.uint16).tobytes())
    for number in ("nan", "inf"):
        broken = np.full((3, 3), float(number), np.float32).tobytes()
        gltf(f"glTF positions {number}", lambda made: None, broken + INDICES)
    gltf("glTF nodes in a ring", patched("nodes", [{"children": [1], "mesh": 0}, {"children": [2]}, {"children": [1]}]))
    gltf("glTF nodes of which each holds ten of the next", patched("nodes", tree(10, 12)))
    gltf("glTF nodes on a ladder of 2^40 ways", patched("nodes", shared(40)))
    gltf("glTF nodes nested 20000 deep", patched("nodes", tree(1, 20000)))
    gltf("glTF with 4000 copies of a mesh of 20000 triangles", crowd, POSITIONS + bytes(120000))
    gltf("glTF with 4000 meshes out of one buffer", copies, bytes(360000) + INDICES)
    for uri in ("http://localhost:9/m.bin", "file:///etc/hostname", "../m.bin", "/etc/hostname", "data:;base64,!!!"):
        gltf(f"glTF buffer at {uri}", patched("buffers.0.uri", uri))
    gltf("glTF buffer at a null character", patched("buffers.0.uri", "a\0b"))


def add_models() -> None:
    text_file("OBJ of 0 bytes", "")
    text_file("OBJ of zeros", bytes(100000))
    for number in ("nan", "inf", "1e39", "1e400"):
        text_file(f"OBJ position {number}", f"v 0 0 {number}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text_file("OBJ index out of range", TRIANGLE + "f 1 2 9\n")
    text_file("OBJ index of 30 digits", TRIANGLE + f"f 1 2 {10**29}\n")
    text_file("OBJ negative index out of range", TRIANGLE + "f -1 -2 -9\n")
    text_file("OBJ face of one vertex repeated", TRIANGLE + "f 1 1 1\n")
    text_file("OBJ with a line of a million characters", TRIANGLE + "f " + "0" * 1000000 + "x\n")
    text_file("OBJ with a million slashes", TRIANGLE + "f 1" + "/" * 1000000 + " 2 3\n")
    text_file("OBJ polygon of 9000 corners", TRIANGLE + "f " + "1 2 3 " * 3000 + "\n", picture=True)
    text_file("OBJ texture coordinates out of range", TRIANGLE + UV + "f 1/1 2/2 3/9\n")
    text_file("OBJ names that are not UTF-8", b"o \xff\xfe\n" + (TRIANGLE + "f 1 2 3\n").encode(), picture=True)
    text_file("OBJ normals nan", TRIANGLE + "vn nan inf 0\nf 1//1 2//1 3//1\n", picture=True)
    text_file("PLY with more vertices than lines", ply("7", "1", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), file="m.ply")
    text_file("PLY with 10^12 vertices", ply(str(10**12), "1", "0 0 0\n"), file="m.ply")
    text_file("PLY with -1 vertices", ply("-1", "1", "0 0 0\n"), file="m.ply")
    text_file("PLY with a face of 255 corners", ply("3", "1", "0 0 0\n1 0 0\n0 1 0\n255 0 1 2\n"), file="m.ply")
    binary = ply("1000000000", "1000000000", "").replace("ascii", "binary_little_endian")
    text_file("PLY binary with 10^9 vertices", binary, file="m.ply")
    text_file("STL with 2^32 - 1 triangles", bytes(80) + b"\xff\xff\xff\xff" + bytes(50), file="m.stl")
    text_file("STL with a NaN", bytes(80) + struct.pack("<I12fH", 1, *[float("nan")] * 12, 0), file="m.stl")
    text_file("OFF with 10^12 vertices", f"OFF\n{10**12} 1 0\n0 0 0\n", file="m.off")
    text_file("OFF index out of range", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 5\n", file="m.off")
    text_file("zip within a zip", zipped("m.zip", zipped("m.obj", b"v 0 0 0\n")), file="m.zip")
    text_file("zip of 64 MiB of zeros", zipped("m.obj", bytes(1 << 26)), file="m.zip")
    text_file("a picture called a model", png(2, 2), file="m.ply")
    text_file("gzip called a model", gzip.compress(bytes(1 << 24)), file="m.glb")


def add_images() -> None:
    image_file("image of 0 bytes", b"")
    image_file("image cut short", png(64, 64)[:60])
    image_file("image that is text", b"<svg onload='run()'/>")
    image_file("PNG of 60000 x 60000", png(60000, 60000, rows=1))
    image_file("PNG of 2^31 - 1 pixels a side", huge_png())
    image_file("PNG bomb of 8200 x 8200 zeros", png(8200, 8200))
    image_file("PNG of width 0", png(0, 5))
    image_file("PNG with rows missing", png(64, 64, rows=3))
    image_file("BMP of 30000 x 30000 without pixels", bmp(30000, 30000), "i.bmp")
    postscript = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\n(run) print\n%%EOF\n"
    image_file("PostScript, which would be run", postscript, "i.eps")
    outside("image in the folder above", "../secret.png")
    outside("image at an absolute path", "{folder}/secret.png")
    outside("image by way of percent signs", "%2e%2e/secret.png")
    outside("image by way of backslashes", "..\\secret.png")
    outside("image by file:", "file://{folder}/secret.png")
    outside("image by http:", "http://localhost:9/secret.png")

    def inline(content: bytes) -> Callable[[dict[str, Any]], None]:
        def change(made: dict[str, Any]) -> None:
            uri = "data:image/png;base64," + base64.b64encode(content).decode()
            made |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
            made["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
            made["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"})
            made["meshes"][0]["primitives"][0] |= {"material": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 2}}

        return change

    gltf("glTF image of 0 bytes", inline(b""))
    gltf("glTF image bomb", inline(huge_png()))
    gltf("glTF image that is PostScript", inline(postscript))


def add_scene_files() -> None:
    model = '[[model]]\npath = "m.obj"\n'
    scene_file("TOML of 0 bytes", "")
    scene_file("TOML that is not UTF-8", b'name = "\xff\xfe"\n')
    scene_file("TOML nested 100000 deep", "a = " + "[" * 100000)
    scene_file("TOML with tables 5000 deep", model + "[camera" + ".a" * 5000 + "]\n")
    scene_file("TOML with [render.set] 5000 deep", model + "[render.set" + ".a" * 5000 + "]\n")
    scene_file("TOML with a key twice", model + model.replace("[[model]]\n", ""))
    scene_file("TOML with a number of 5000 digits", model + f"scale = {'9' * 5000}\n")
    scene_file("TOML where the model is a number", "model = 3\n")
    scene_file("TOML where the camera is a list", model + "[[camera]]\nfov = 3\n")
    scene_file("TOML with a NaN", model + "scale = nan\n")
    scene_file("TOML with infinity", model + "translate = [0, inf, 0]\n")
    scene_file("TOML with a scale of 1e-300", model + "scale = 1e-300\n")
    scene_file("TOML whose model is itself", '[[model]]\npath = "scene.toml"\n')
    scene_file("TOML whose model is a device", '[[model]]\npath = "/dev/zero"\n')
    scene_file("TOML whose model is its folder", '[[model]]\npath = "."\n')
    scene_file("TOML whose model is on the web", '[[model]]\npath = "http://localhost:9/m.obj"\n')
    scene_file("TOML with a null character in a path", '[[model]]\npath = "a\\u0000b.obj"\n')
    scene_file("TOML with a name of 100000 characters", model + f'[render]\ngraph = "{"x" * 100000}"\nsize = "0x0"\n')
    scene_file("TOML with 20000 faults", model + "".join(f"x{index} = 1\n" for index in range(20000)))
    graph = model + '[render]\nset = {"os.system" = "touch run"}\n'
    scene_file("TOML that would set a function", graph)


for add in (add_gltf, add_models, add_images, add_scene_files):
    add()

CASES = FILES
