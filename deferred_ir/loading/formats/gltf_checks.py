"""Checks the sizes, offsets, indices and node tree of a glTF document before trimesh reads it.

trimesh accepts cyclic nodes, negative indices and unbounded copies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from deferred_ir.base.errors import SceneError, format_value

Json = dict[str, Any]

LARGEST = 1 << 25
"""Most vertices and indices that the nodes of a file may place altogether."""
DEEPEST = 256
"""Most levels of nodes."""

BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check(document: Json, buffers: Sequence[bytes]) -> None:
    """Raise SceneError for the first number of `document` that does not fit `buffers`, its buffers' contents."""
    buffer_views = _get_list(document, "bufferViews")
    views = [_check_view(f"bufferViews[{index}]", view, buffers) for index, view in enumerate(buffer_views)]
    accessors = _get_list(document, "accessors")
    for index, accessor in enumerate(accessors):
        _check_accessor(f"accessors[{index}]", accessor, buffer_views, views)
    meshes = _get_list(document, "meshes")
    sizes = [_count_mesh(f"meshes[{index}]", mesh, document) for index, mesh in enumerate(meshes)]
    nodes = _get_list(document, "nodes")
    for index, node in enumerate(nodes):
        if "mesh" in node:
            _get_index(f"nodes[{index}]", node, "mesh", len(meshes))
    _check_tree(nodes)
    for index, scene in enumerate(_get_list(document, "scenes")):
        for root in scene.get("nodes", []):
            _check_index(f"scenes[{index}].nodes", root, len(nodes))
    # What no node places is read all the same, once.
    total = sum(sizes) + sum(sizes[node["mesh"]] for node in nodes if "mesh" in node)
    if total > LARGEST:
        raise SceneError(
            f"its nodes place {total} vertices and indices, and {LARGEST} are the most; place fewer copies"
        )


def _get_list(document: Json, key: str) -> list[Json]:
    value = document.get(key, [])
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise SceneError(f"{key}: must be an array of objects; export it again")
    return value


def _check_index(where: str, value: Any, count: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
        raise SceneError(f"{where}: {format_value(value)} is none of the {count} that there are; export it again")
    return value


def _get_index(where: str, table: Mapping[str, Any], key: str, count: int) -> int:
    return _check_index(f"{where}.{key}", table.get(key), count)


def _get_integer(where: str, table: Json, key: str, default: int | None = None, least: int = 0) -> int:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise SceneError(f"{where}.{key}: {format_value(value)} is no whole number from {least} up; export it again")
    return value


def _check_view(where: str, view: Json, buffers: Sequence[bytes]) -> int:
    """Return the length of a view after checking that it lies within its buffer."""
    start, length = _get_integer(where, view, "byteOffset", 0), _get_integer(where, view, "byteLength", least=1)
    there = len(buffers[_get_index(where, view, "buffer", len(buffers))])
    if start + length > there:
        raise SceneError(f"{where}: ends at byte {start + length} of {there} that there are; export it again")
    return length


def _check_accessor(where: str, accessor: Json, views: list[Json], lengths: list[int]) -> None:
    kind, form = accessor.get("componentType"), accessor.get("type")
    if kind not in BYTES or form not in COMPONENTS:
        raise SceneError(
            f"{where}: no such kind of number: {format_value(kind)}, {format_value(form)}; export it again"
        )
    count, start = _get_integer(where, accessor, "count", least=1), _get_integer(where, accessor, "byteOffset", 0)
    if "bufferView" not in accessor:
        return  # refused where something uses it
    index = _get_index(where, accessor, "bufferView", len(views))
    item = BYTES[kind] * COMPONENTS[form]
    stride = _get_integer(f"bufferViews[{index}]", views[index], "byteStride", item, least=item)
    end = start + (count - 1) * stride + item
    if end > lengths[index]:
        raise SceneError(f"{where}: {count} items end at byte {end} of {lengths[index]} in its view; export it again")


def _count_mesh(where: str, mesh: Json, document: Json) -> int:
    """Return the number of vertices and indices of a mesh."""
    accessors, total = _get_list(document, "accessors"), 0
    for number, primitive in enumerate(_get_list(mesh, "primitives")):
        name = f"{where}.primitives[{number}]"
        used = {"attributes." + key: value for key, value in primitive["attributes"].items()}
        used |= {"indices": primitive["indices"]} if "indices" in primitive else {}
        counts = {key: accessors[_get_index(name, used, key, len(accessors))]["count"] for key in used}
        if "material" in primitive:
            _get_index(name, primitive, "material", len(_get_list(document, "materials")))
        total += counts.get("attributes.POSITION", 0) + counts.get("indices", 0)
    return total


def _check_tree(nodes: list[Json]) -> None:
    """Check that nodes form trees: each has at most one parent, none is its own ancestor, and none lies too deep."""
    parents: dict[int, int] = {}
    for index, node in enumerate(nodes):
        for child in node.get("children", []):
            _check_index(f"nodes[{index}].children", child, len(nodes))
            if child in parents:
                raise SceneError(f"nodes[{index}].children: {child} is a child of two nodes; export it again")
            parents[child] = index
    depths = {index: 0 for index in range(len(nodes)) if index not in parents}
    level = list(depths)
    while level:
        level = [child for index in level for child in nodes[index].get("children", [])]
        for child in level:
            depths[child] = depths[parents[child]] + 1
            if depths[child] > DEEPEST:
                raise SceneError(f"nodes[{child}]: lies deeper than {DEEPEST} levels; flatten the file's nodes")
    if len(depths) < len(nodes):
        ring = next(index for index in range(len(nodes)) if index not in depths)
        raise SceneError(f"nodes[{ring}]: is its own ancestor; export it again")
