"""The variants of the Z-sampler."""

from jax import Array

from qmcjax.core import checks, draws
from qmcjax.orders import VARIANTS, ScrambledMorton, log_side, scrambled_morton
from qmcjax.samplers._z_blocks import MAX_SPP, Z
from qmcjax.samplers._z_index import of_key
from qmcjax.sequences import BinarySequence, as_binary, sobol

PLAIN = "plain"

MAX_DIMS = 2**16


def z(
    width: int,
    height: int,
    spp: int,
    key: Array | int | None,
    variant: str = "hash",
    dims: int | None = None,
    constituents: tuple[int, ...] | None = None,
    sequence: BinarySequence | None = None,
    alphabet: int | None = None,
    frames: int | None = None,
) -> Z:
    """Sample the pixels with blocks of the Sobol' sequence along a scrambled Morton order, to diffuse errors.

    Dimensions are padded: each pair of coordinates, or a single one, is a constituent that takes the first
    coordinates of the same Sobol' sequence, along its own order of the pixels. In a constituent, every
    aligned square of ``2**k`` pixels per side has a contiguous aligned block of ``4**k * spp`` points. The
    order continues below the pixels, with the numbers of their samples.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the orders cover the enclosing square with a power of two as side
    spp : int
        Samples per pixel: a power of two, at most 2**31. For fewer, see Notes; for more, see
        ``Z.extended``; for different numbers per pixel, ``Z.adaptive``.
    key : jax.random.key, or int in [0, 2**32)
        A new key does not recompile. "plain" ignores it: None is allowed there.
    variant : {"plain", "hash", "multiplicative", "tree", "art"}
        "plain" is Z0 of the paper: Morton order for all constituents. Their coordinates repeat: use a joint
        ``sequence`` for more than two dimensions. For the others see :func:`qmcjax.orders.scrambled_morton`.
        The paper's Z_hash is "multiplicative"; the hash of "hash" mixes its arguments more thoroughly.
        "tree" and "art" share one production among all constituents, with separate permutations (Eq. 13 to
        18); "tree" also starts at separate letters.
    dims : int, optional
        Number of coordinates, in [1, 65536], by default 2, in pairs; if it is odd, the last one is single.
    constituents : tuple of int, optional
        Alternative to ``dims``: the sizes of the constituents, each 1 or 2, for coordinates 0, 1, ...
    sequence : sequence in base 2, optional
        Alternative to ``dims``: a joint sequence for all dimensions, with a single order. It must have a
        point for each sample of the padded raster.
    alphabet : int, optional
        For "tree" only: the number of letters, in [1, 65536], by default 4096.
    frames : int, optional
        For animations: a number of frames, at least 1. The points do not depend on it, and you can render
        further frames.

    Returns
    -------
    Z
        With ``frames``, ``sampler.at_frame(t)`` is the sampler of frame t.

    Notes
    -----
    With ``frames``, the sequence of each constituent moves in time, by :func:`qmcjax.sequences.in_time`;
    constituents after the first scramble the order of the frames. So in every aligned window of ``2**k`` x
    ``2**k`` pixels and ``2**j`` frames, **each coordinate has exactly one sample in each of 4**k * 2**j *
    spp equal intervals**, for any k and j, up to 2**32 intervals; each frame has the nets of a single image.

    If the raster has more than 2**32 samples, indices have 64 bits, and coordinates are exact to 32 digits.
    See :func:`contiguous` for the joint sequences that support these indices.

    If spp is an odd power of two, the last bit of a sample's number is xored with a random bit.

    All samples of a pixel are a (0, log2(spp), 2)-net in each two-dimensional constituent. The best numbers
    of fewer samples are ``4**k`` if spp is a power of four, else ``2 * 4**k``: these are nets, too. With
    twice as many, only a third of the pixels have a net. At two positions that differ only in the last bit,
    any two samples differ in each coordinate by an odd multiple of ``1 / (2 * spp)`` [1]_ (Appendix A states
    this for four samples, but prints the multiples of 1/8 for eight).

    Over an image, coordinates of different constituents are jointly as uniform as random points for "hash"
    and "tree". For "art" they are not: the place of a node determines its letter, and each of the 4096
    letters has one permutation for each constituent. So chi-squared of two such coordinates exceeds its mean
    by a factor of up to 1 + pixels / 4096. "multiplicative" may be as bad.

    Only the orders are random: the expectation of a pixel over keys is the mean over the points of all
    pixels, not the integral. Each sample, including the first, is uniform up to the cells of these points.
    With a randomised joint ``sequence`` it is uniform, and the expectation is the integral.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Sect. 3, 4.4, and Appendix A.

    Examples
    --------
    >>> sampler = z(64, 64, 4, key=1, dims=5)
    >>> print(sampler(3, 5, 0, dims=(2, 3, 4)).shape)
    (3,)
    >>> print(z(64, 64, 1, None, "plain")(3, 1, 0))  # point 7 of the Sobol' sequence
    [0.875 0.875]
    """
    width, height = checks.image_size(width, height)
    spp = checks.power_of_two("spp", spp, MAX_SPP)
    if sum(given is not None for given in (dims, constituents, sequence)) > 1:
        raise ValueError(
            f"dims, constituents, sequence: at most one must be given, got dims={checks.shown(dims)}, "
            f"constituents={checks.shown(constituents)}, sequence={checks.shown(sequence)}"
        )
    if sequence is None:
        sizes, sequence = _padded(2 if dims is None else dims, constituents), sobol(2)
    else:
        sizes = (as_binary("sequence", sequence).dims,)
        pixels = 4 ** log_side(width, height)
        if pixels * spp > sequence.limit_64:
            raise ValueError(
                f"spp must be at most {sequence.limit_64 // pixels}: the padded raster has {pixels} pixels "
                f"and the sequence {sequence.limit_64} indices, got {spp}"
            )
    orders = _orders(width, height, key, variant, alphabet, len(sizes))
    of_frames = None if frames is None else of_key(frames, sequence, key, len(sizes))
    return Z(width, height, orders, sequence, spp, sizes, frames=of_frames)


def _padded(dims: int, constituents: tuple[int, ...] | None) -> tuple[int, ...]:
    if constituents is None:
        pairs, single = divmod(checks.integer("dims", dims, 1, MAX_DIMS), 2)
        return (2,) * pairs + (1,) * single
    wanted = f"constituents must be a tuple of 1s and 2s, at most {MAX_DIMS} together"
    if not isinstance(constituents, tuple | list):
        raise TypeError(f"{wanted}, got {checks.shown(constituents)}")
    sizes = tuple(checks.integer("constituents", size, 1, 2) for size in constituents)
    if not 1 <= sum(sizes) <= MAX_DIMS:
        raise ValueError(f"{wanted}, got {checks.shown(constituents)}")
    return sizes


def _orders(
    width: int, height: int, key: Array | int | None, variant: str, alphabet: int | None, count: int
) -> ScrambledMorton | None:
    if checks.choice("variant", variant, (PLAIN, *VARIANTS)) == PLAIN:
        if alphabet is not None:
            raise ValueError(f"alphabet must be given for variant='tree' only, got {alphabet!r}")
        return None
    of_first, of_others = draws.split(checks.prng_key("key", key))
    order = scrambled_morton(width, height, of_first, variant, alphabet)
    return order.family(draws.split(of_others, count - 1))
