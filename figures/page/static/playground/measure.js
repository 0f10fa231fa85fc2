// Errors, spectra and pictures of images, for a worker.
const measuring = () => {
  // Discrete Fourier transforms along the first axis of n x n numbers, by the prime factors of n (Stockham).
  const factorsOf = (n) => {
    for (let p = 2; p * p <= n; p++) if (n % p === 0) return [p, ...factorsOf(n / p)];
    return n > 1 ? [n] : [];
  };
  const along = ([re, im], n, sign) => {
    const [cos, sin] = [Math.cos, Math.sin].map((f) => Float64Array.from({ length: n }, (_, k) => f((2 * Math.PI * k) / n)));
    let length = 1; // of the transforms that are finished, each of every (n / length)-th row
    for (const p of factorsOf(n)) {
      const [newRe, newIm] = [new Float64Array(n * n), new Float64Array(n * n)];
      const block = (n / (length * p)) * n;
      for (let k = 0; k < length * p; k++) {
        for (let q = 0; q < p; q++) {
          const turn = ((q * k * n) / (length * p)) % n;
          const [c, s] = [cos[turn], sign * sin[turn]];
          const [from, to] = [((k % length) * p + q) * block, k * block];
          for (let j = 0; j < block; j++) {
            newRe[to + j] += c * re[from + j] - s * im[from + j];
            newIm[to + j] += c * im[from + j] + s * re[from + j];
          }
        }
      }
      [re, im, length] = [newRe, newIm, length * p];
    }
    return [re, im];
  };
  const transposed = (pair, n) => pair.map((of) => of.map((_, k) => of[(k % n) * n + Math.floor(k / n)]));
  const transform = (pair, n, sign) => transposed(along(transposed(along(pair, n, sign), n), n, sign), n);

  // Transfer functions of filters, as analysis.filtered_error and analysis.perceived_error have them.
  const frequency = (k, n) => (k < n - k ? k : k - n) / n;
  const gaussian = (f, sigma) => {
    let sum = 0;
    for (let copy = -8; copy <= 8; copy++) sum += Math.exp(-2 * (Math.PI * sigma * (f + copy)) ** 2);
    return sum;
  };
  const PEAK = 7.890914609139; // cycles per degree that the eye sees best
  const eye = (f) => (0.0192 + 0.114 * f) * Math.exp(-((0.114 * f) ** 1.1));
  const FILTERS = {
    none: () => 1,
    gaussian: (x, y) => (gaussian(x, 1.5) * gaussian(y, 1.5)) / gaussian(0, 1.5) ** 2,
    eye: (x, y) => eye(Math.max(PEAK, Math.hypot(x, y) * 2000 * Math.tan(Math.PI / 180))) / eye(PEAK),
  };

  let [n, weights, exact, exactWaves] = [];
  let sides = [null, null]; // the difference from the exact image, its transform and its errors

  const start = ({ side, reference }) => {
    if (side !== n) {
      n = side;
      weights = Object.fromEntries(Object.entries(FILTERS).map(([name, of]) => [name, Float64Array.from(
        { length: n * n }, (_, k) => of(frequency(k % n, n), frequency(Math.floor(k / n), n)))]));
    }
    exact = reference;
    exactWaves = transform([exact, new Float64Array(n * n)], n, -1);
    sides = [null, null];
  };
  // The root mean square of the difference after each filter, by Parseval's equation.
  const measure = ({ at, sums, count }) => {
    const difference = Float64Array.from(exact, (value, k) => (sums === null ? 0 : sums[k] / count - value));
    const waves = transform([difference, new Float64Array(n * n)], n, -1);
    const power = difference.map((_, k) => waves[0][k] ** 2 + waves[1][k] ** 2);
    const errors = Object.fromEntries(Object.entries(weights).map(([name, weight]) => [
      name, Math.sqrt(power.reduce((sum, value, k) => sum + weight[k] ** 2 * value, 0)) / (n * n)]));
    sides[at] = { difference, waves, power, errors };
    return errors;
  };

  // As figures/making/web_images.py shows images, differences and spectra.
  const SRGB = Uint8Array.from({ length: 4097 }, (_, k) => {
    const value = k / 4096;
    return Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));
  });
  const filtered = (waves, filter) => {
    const weight = weights[filter];
    const [values] = transform(waves.map((of) => of.map((value, k) => (weight[k] * value) / (n * n))), n, 1);
    return values;
  };
  const roundedUp = (value) => {
    if (value === 0) return 1;
    const power = Math.floor(Math.log10(value));
    return [1, 2, 5, 10].map((step) => Number(`${step}e${power}`)).find((step) => value <= step * (1 + 1e-6));
  };
  const greys = {
    file: ({ difference, waves }, filter) => {
      const values = filter === "none" ? difference.map((value, k) => value + exact[k])
        : filtered(waves.map((of, part) => of.map((value, k) => value + exactWaves[part][k])), filter);
      return values.map((value) => SRGB[Math.round(4096 * Math.min(1, Math.max(0, value)))]);
    },
    difference: ({ difference, waves }, filter, scale) => {
      const values = filter === "none" ? difference : filtered(waves, filter);
      return values.map((value) => 127.5 + 127.5 * Math.min(1, Math.max(-1, value / scale)));
    },
    // In decades of the mean power of the unfiltered difference, frequency 0 in the middle.
    spectrum: ({ power }, filter) => {
      const mean = power.reduce((sum, value, k) => (k ? sum + value : 0), 0) / (n * n);
      return power.map((_, k) => {
        const [x, y] = [k % n, Math.floor(k / n)].map((place) => (place + n - (n >> 1)) % n);
        const from = y * n + x;
        const value = from && mean ? (power[from] * weights[filter][from] ** 2) / mean : 0;
        return 255 * Math.min(1, Math.max(0, (Math.log10(Math.max(value, 1e-9)) + 2) / 4));
      });
    },
  };
  const show = ({ view, filter }) => {
    const scale = roundedUp(3 * Math.max(...sides.map((of) => of?.errors[filter] ?? 0)));
    const pictures = sides.map((of) => {
      if (!of) return null;
      const pixels = new Uint8ClampedArray(4 * n * n).fill(255);
      greys[view](of, filter, scale).forEach((grey, k) => pixels.fill(grey, 4 * k, 4 * k + 3));
      return pixels;
    });
    return { pictures, scale, view, filter };
  };

  const forget = (at) => { sides[at] = null; };

  return { start, measure, forget, show };
};
