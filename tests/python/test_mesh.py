"""The mesh is a GLB that a third-party library reads, with the frame's vertices in the frame's order."""

import io
import json
import struct

import numpy as np
import trimesh


def accessor(glb, index):
    """An accessor's numbers, read without the node's transform as the protocol says."""
    n_json = struct.unpack_from("<I", glb, 12)[0]
    document, binary = json.loads(glb[20:20 + n_json]), glb[28 + n_json:]
    a = document["accessors"][index]
    view = document["bufferViews"][a["bufferView"]]
    offset = view.get("byteOffset", 0) + a.get("byteOffset", 0)
    kind = {5126: "<f4", 5125: "<u4", 5123: "<u2"}[a["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
    return document, np.frombuffer(binary, kind, a["count"] * width, offset).reshape(-1, width)


def test_the_mesh_has_the_frames_vertices_in_the_frames_order(client):
    glb = client.mesh()
    frame = client.frame()
    status = client.status()["objects"]["wedge"]
    assert frame.positions.shape == (status["n_vertices"], 3)

    document = json.loads(glb[20:20 + struct.unpack_from("<I", glb, 12)[0]])
    (primitive,) = document["meshes"][0]["primitives"]
    _, rest = accessor(glb, primitive["attributes"]["POSITION"])
    assert rest.shape == frame.positions.shape
    assert np.array_equal(rest, frame.positions), "nothing has touched the object, so the frame is the rest shape"


def test_a_third_party_library_reads_the_mesh(client):
    status = client.status()["objects"]["wedge"]
    scene = trimesh.load(io.BytesIO(client.mesh()), file_type="glb", process=False)
    (mesh,) = scene.geometry.values()
    assert len(mesh.vertices) == status["n_vertices"] and len(mesh.faces) == status["n_triangles"]
    frame = client.frame().positions
    assert np.allclose(mesh.vertices, frame, atol=1e-7), "vertex i of the mesh is vertex i of the frame"
    assert mesh.is_watertight and mesh.is_winding_consistent
    # 120 x 60 mm, height 40 tapering to 10 mm.
    assert abs(mesh.volume / (0.12 * 0.06 * 0.025) - 1) < 1e-3, "outward triangles enclose the wedge's volume"
    # The node turns z up into glTF's y up.
    extents = scene.extents
    assert np.allclose(extents, [0.12, 0.04, 0.06], atol=1e-6), extents
