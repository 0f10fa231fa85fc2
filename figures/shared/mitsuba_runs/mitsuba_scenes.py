"""Still scenes of ours as Mitsuba 3 takes them, and what it makes of them."""

import tempfile
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures.making import this_machine
from figures.shared.mitsuba_runs import mitsuba_process
from qmcjax import tracing

PLANE = 1e3
"""Radius of the disc that stands for a plane."""


def installed() -> bool:
    """Tell whether there is a Mitsuba to run."""
    return find_spec("mitsuba") is not None


def render_image(
    scene: tracing.Estimator, width: int, height: int, spp: int, seeds: list[int]
) -> tuple[NDArray[np.float32], list[float]]:
    """Return images (seeds, height, width, 3) by independent samples and the seconds that each took.

    In a separate process, since Mitsuba may abort the one that it is in. All of its threads render.
    """
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": describe(scene, width, height), "spp": spp, "seeds": seeds, "folder": folder}
        this_machine.run_apart(mitsuba_process, task=task)
        with np.load(Path(folder) / mitsuba_process.RESULT) as result:
            return result["images"], result["seconds"].tolist()


def describe(scene: tracing.Estimator, width: int, height: int) -> dict[str, Any]:
    """Return the dictionary that Mitsuba loads, in JSON: matrices and triangles are lists.

    The last surface of a path of ours is lit by lights that are sampled, of Mitsuba's by those that a mirror
    there shows, too. With several bounces that is little.

    Raises ValueError if the scene moves or has no counterpart: textures, microfacets (Fresnel's factor and
    masking differ), emitters that shine on both sides, polygonal apertures, and mirrors in direct light.
    """
    if "time" in scene.needs:
        raise ValueError(f"scene must be still, got one that needs {scene.needs}")
    time = float(np.ravel(scene.camera.shutter)[0])
    parts = {
        f"object{number}_{place}_{row}": primitive | {"bsdf": _material(item.material)}
        for number, item in enumerate(scene.world.objects)
        for place, shape in enumerate(item.shapes)
        for row, primitive in enumerate(_primitives(shape.at(time), _placed(item, time)))
    }
    lights = {f"light{number}": _light(light) for number, light in enumerate(scene.world.lights)}
    sensor = _sensor(scene.camera, width, height)
    return {"type": "scene", "integrator": _integrator(scene), "sensor": sensor, **parts, **lights}


def _integrator(scene: tracing.Estimator) -> dict[str, Any]:
    match scene:
        case tracing.PathTracing(roulette=None):
            # The edges of a path: to the first surface, the bounces, and to a light.
            return {"type": "path", "max_depth": scene.bounces + 2, "rr_depth": 1000}
        case tracing.DirectLight(mirrors=0):
            return {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
    raise ValueError("scene must be of path tracing without roulette, or of direct light without mirrors")


def _sensor(camera: tracing.Camera, width: int, height: int) -> dict[str, Any]:
    if camera.motion is not None or camera.blades is not None:
        raise ValueError("camera must have neither a motion nor blades")
    aspect = float(camera.aspect)
    if not np.isclose(aspect, width / height):
        raise ValueError(f"the image must have the camera's aspect {aspect}, got {width} x {height}")
    position, target, up = (np.asarray(a, np.float64) for a in (camera.position, camera.target, camera.up))
    forward = (target - position) / np.linalg.norm(target - position)
    # Its camera looks along z, and x is to the left.
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    film = {"type": "hdrfilm", "pixel_format": "rgb", "component_format": "float32"}
    sensor = {
        "to_world": _matrix([left, np.cross(forward, left), forward], position),
        "fov": float(camera.fov),
        "fov_axis": "y",
        "near_clip": 1e-3,
        "film": film | {"width": width, "height": height, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent"},
    }
    if camera.aperture is None:
        return sensor | {"type": "perspective"}
    focus = np.linalg.norm(target - position) if camera.focus is None else camera.focus
    return sensor | {
        "type": "thinlens",
        "aperture_radius": float(camera.aperture),
        "focus_distance": float(focus),
    }


Placed = tuple[NDArray[np.float64], NDArray[np.float64]]
"""An affine map: columns as rows, and a translation."""


def _placed(item: tracing.Object, time: float) -> Placed:
    frame = item.frame(jnp.array([time], jnp.float32))
    if frame is None:
        return np.eye(3), np.zeros(3)
    return np.array(frame.columns, np.float64)[..., 0], np.array(frame.translation, np.float64)[:, 0]


def _primitives(shape: tracing.Shape, place: Placed) -> list[dict[str, Any]]:
    """Return a shape's primitives; triangles are one mesh."""

    def affine(kind: str, columns: Any, origin: Any) -> dict[str, Any]:
        matrix, translation = place
        columns, origin = np.asarray(columns, np.float64), np.asarray(origin, np.float64)
        return {"type": kind, "to_world": _matrix(columns @ matrix, origin @ matrix + translation)}

    rows = zip(
        *(np.asarray(part, np.float64) for part in vars(shape).values() if part is not None), strict=True
    )
    match shape:
        case tracing.Sphere():
            return [affine("sphere", radius * np.eye(3), center) for center, radius in rows]
        case tracing.Box():
            return [affine("cube", np.diag((high - low) / 2), (low + high) / 2) for low, high in rows]
        case tracing.Rectangle():
            return [affine("rectangle", *_rectangle(*row)) for row in rows]
        case tracing.Disc():
            return [affine("disk", radius * _frame(axis), center) for center, axis, radius in rows]
        case tracing.Plane():
            return [affine("disk", PLANE * _frame(axis), point) for point, axis in rows]
        case tracing.Cylinder():
            return [
                affine(
                    "cylinder", np.array([[radius], [radius], [np.linalg.norm(axis)]]) * _frame(axis), base
                )
                for base, axis, radius in rows
            ]
        case tracing.Triangles():
            matrix, translation = place
            vertices = np.asarray(shape.vertices, np.float64) @ matrix + translation
            return [{"type": "ply", "triangles": vertices.tolist(), "face_normals": True}]
    raise ValueError(f"shape must be one that Mitsuba has, got {type(shape).__name__}")


def _rectangle(corner: Any, edge_u: Any, edge_v: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the columns and the origin of the map from the square between -1 and 1 with the normal z."""
    corner, edge_u, edge_v = (np.asarray(part, np.float64) for part in (corner, edge_u, edge_v))
    normal = np.cross(edge_u, edge_v)
    columns = [edge_u / 2, edge_v / 2, normal / np.linalg.norm(normal)]
    return np.array(columns), corner + (edge_u + edge_v) / 2


def _frame(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.argmin(abs(z))])
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z], np.float64)


def _material(material: Any) -> dict[str, Any]:
    match material:
        case None:
            of_side = {"type": "diffuse", "reflectance": _color(tracing.diffuse(0.5).color)}
        case tracing.Diffuse():
            of_side = {"type": "diffuse", "reflectance": _color(material.color)}
        case tracing.Mirror():
            reflectance = _color(material.color)
            of_side = {"type": "conductor", "material": "none", "specular_reflectance": reflectance}
        case _:
            raise ValueError(f"material must be diffuse or a mirror, got {type(material).__name__}")
    return {"type": "twosided", "material": of_side}


def _light(light: tracing.Light) -> dict[str, Any]:
    match light:
        case tracing.PointLight():
            return {
                "type": "point",
                "to_world": _matrix(np.eye(3), light.position),
                "intensity": _color(light.intensity),
            }
        case tracing.Environment():
            return {"type": "constant", "radiance": _color(light.radiance)}
        case tracing.SphereLight():
            place = _matrix(float(light.radius) * np.eye(3), light.center)
            shape: dict[str, Any] = {"type": "sphere", "to_world": place}
        case tracing.RectangleLight():
            place = _matrix(*_rectangle(light.corner, light.edge_u, light.edge_v))
            shape = {"type": "rectangle", "to_world": place}
        case _:
            raise ValueError(f"light must be one that Mitsuba has, got {type(light).__name__}")
    # Without a BSDF it would reflect one half.
    black = {"type": "diffuse", "reflectance": _color(0.0)}
    return shape | {"emitter": {"type": "area", "radiance": _color(light.radiance)}, "bsdf": black}


def _matrix(columns: Any, origin: Any) -> dict[str, Any]:
    """Return an affine map as Mitsuba's process takes it."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.transpose(np.asarray(columns, np.float64))
    matrix[:3, 3] = origin
    return {"type": "matrix", "rows": matrix.tolist()}


def _color(color: Any) -> dict[str, Any]:
    if callable(color):
        raise ValueError(f"colours must be constant, got {type(color).__name__}")
    return {"type": "rgb", "value": np.broadcast_to(np.asarray(color, np.float64), 3).tolist()}


def plain(scene: tracing.PathTracing) -> tracing.PathTracing:
    """Return a scene in which textures are their first colour, and without surfaces that shine."""
    objects = [
        replace(item, material=_plain(item.material))
        for item in scene.world.objects
        if not isinstance(item.material, tracing.Emitter)
    ]
    return replace(scene, world=tracing.world(objects, scene.world.lights))


def _plain(material: Any) -> tracing.Diffuse:
    color = tracing.diffuse(0.5).color if material is None else material.color
    return tracing.diffuse(color.one if isinstance(color, tracing.Pattern) else color)
