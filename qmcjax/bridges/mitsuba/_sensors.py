"""Samplers in loaded scenes, for any sensor."""

from os import PathLike
from pathlib import Path
from typing import Any

from qmcjax.bridges.mitsuba._given import LIMIT
from qmcjax.bridges.mitsuba._register import NAME, import_mitsuba, register, wrap
from qmcjax.core import checks


def render(
    scene: Any, sampler: Any, spp: int | None = None, seed: int = 0, key: int = 0, sensor: int = 0
) -> Any:
    """Render a Mitsuba 3 scene with another sampler.

    Parameters
    ----------
    scene : path of an XML file, or mitsuba.Scene
        A file is loaded in the current variant, see :func:`register`.
    sampler : Sampler, object with the methods of one, function, or mitsuba.Sampler
        As for :func:`wrap`: a function of ``(width, height, spp)`` is called with the size of the film.
    spp : int, optional
        Samples per pixel, by default those of the sampler in the scene.
    seed : int
        The number of the image: image ``seed`` takes the samples from ``seed * spp`` on.
    key : int
        For requests beyond the sampler's dimensions.
    sensor : int
        Which of the scene's sensors.

    Returns
    -------
    mitsuba.TensorXf, shape (height, width, channels)
        The image of the sensor's film, or of its crop window.

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    TypeError, ValueError
        If ``scene`` is neither the path of a file nor a scene of the current variant, if it has no such
        sensor, or if the sampler does not fit the film.

    See Also
    --------
    sensor_with : for several images, other integrators, and derivatives

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> owen = samplers.independent(sequences.sobol(8), key=1)
    >>> image = render("scene.xml", owen, spp=16)  # doctest: +SKIP
    """
    mitsuba, scene = _load_scene(scene)
    own = _sensor_of(scene, sensor).sampler().sample_count()
    spp = checks.integer("spp", own if spp is None else spp, 1, LIMIT)
    seed = checks.integer("seed", seed, 0, LIMIT)
    # Scalar variants derive seeds of pixels from it: theirs must be 0.
    first = 0
    if mitsuba.variant().startswith("scalar") and not isinstance(sampler, mitsuba.Sampler):
        seed, first = 0, checks.integer("seed * spp", seed * spp, 0, LIMIT)
    placed = sensor_with(scene, sampler, sensor, key, first)
    return mitsuba.render(scene, sensor=placed, spp=spp, seed=seed)


def sensor_with(
    scene: Any, sampler: Any, sensor: int = 0, key: int = 0, first_sample: int = 0, film: Any = None
) -> Any:
    """Return a sensor of a scene with another sampler.

    Parameters
    ----------
    scene : path of an XML file, or mitsuba.Scene
    sampler : Sampler, object with the methods of one, function, or mitsuba.Sampler
        As for :func:`wrap`.
    sensor : int
        Which of the scene's sensors.
    key : int
        For requests beyond the sampler's dimensions.
    first_sample : int
        The index of the first sample.
    film : mitsuba.Film, optional
        Replaces the film of the sensor, and shows it on other pixels: it should have the same aspect ratio.

    Returns
    -------
    mitsuba.Sensor, for ``mitsuba.render(scene, sensor=...)``

    Raises
    ------
    ImportError, TypeError, ValueError
        As for :func:`render`.

    Notes
    -----
    It requests rays from the scene's sensor. In scalar variants this is one Python call per sample: sensors
    defined with the plugin are faster.

    Examples
    --------
    >>> import mitsuba  # doctest: +SKIP
    >>> scene = mitsuba.load_file("scene.xml")  # doctest: +SKIP
    >>> sensor = sensor_with(scene, sampler)  # doctest: +SKIP
    >>> images = [mitsuba.render(scene, sensor=sensor, spp=16, seed=k) for k in (0, 1)]  # doctest: +SKIP
    """
    mitsuba, scene = _load_scene(scene)
    own = _sensor_of(scene, sensor)
    if film is not None and not isinstance(film, mitsuba.Film):
        raise TypeError(f"film must be a film of the current variant, got {checks.shown(film)}")
    film = own.film() if film is None else film
    if not isinstance(sampler, mitsuba.Sampler):
        plug_in = {"type": NAME, "sampler": wrap(sampler), "film": film}
        plug_in["key"] = checks.integer("key", key, 0, LIMIT)
        plug_in["first_sample"] = checks.integer("first_sample", first_sample, 0, LIMIT)
        register()
        sampler = mitsuba.load_dict(plug_in | {"sample_count": own.sampler().sample_count()})
    return _delegate(mitsuba, own, film, sampler)


def _load_scene(scene: Any) -> tuple[Any, Any]:
    """Return Mitsuba, and a scene of its current variant."""
    mitsuba = import_mitsuba()
    if mitsuba.variant() is None:
        raise ValueError(
            "scene must be loaded in a variant of Mitsuba, got a scene loaded before register set one"
        )
    if isinstance(scene, str | PathLike):
        if not Path(scene).is_file():
            raise ValueError(f"scene must be the path of a file, got {checks.shown(str(scene))}")
        scene = mitsuba.load_file(str(scene))
    if not isinstance(scene, mitsuba.Scene):
        raise TypeError(
            "scene must be the path of a scene's file, or a scene loaded in the variant "
            f"{mitsuba.variant()}, got {checks.shown(scene)}"
        )
    return mitsuba, scene


def _sensor_of(scene: Any, number: Any) -> Any:
    sensors = scene.sensors()
    if not sensors:
        raise ValueError("scene must have a sensor, got one without")
    return sensors[checks.integer("sensor", number, 0, len(sensors) - 1)]


def _delegate(mitsuba: Any, sensor: Any, film: Any, sampler: Any) -> Any:
    """Return a sensor that requests rays from another one."""

    class Delegate(mitsuba.Sensor):
        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.m_needs_sample_2 = sensor.needs_sample_2()
            self.m_needs_sample_3 = sensor.needs_sample_3()

        def sample_ray(self, *arguments: Any) -> Any:
            return sensor.sample_ray(*arguments)

        def sample_ray_differential(self, *arguments: Any) -> Any:
            return sensor.sample_ray_differential(*arguments)

        def sample_direction(self, *arguments: Any) -> Any:
            return sensor.sample_direction(*arguments)

        def to_string(self) -> str:
            inside = f"sensor = {sensor},\nsampler = {sampler}".replace("\n", "\n  ")
            return f"QmcSensor[\n  {inside}\n]"

    properties = mitsuba.Properties()
    properties["film"], properties["sampler"] = film, sampler
    properties["shutter_open"] = sensor.shutter_open()
    properties["shutter_close"] = sensor.shutter_open() + sensor.shutter_open_time()
    made = Delegate(properties)
    if sensor.get_medium() is not None:
        made.set_medium(sensor.get_medium())
    return made
