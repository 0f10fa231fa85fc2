// What a playground renders with, in a script, since pages from disk cannot read files: base64 of compressed bytes,
// the length of a JSON, the JSON, and arrays that it places (figures/playground/_data.py).
const unpacked = async (text) => {
  const packed = new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]);
  const bytes = new Uint8Array(await new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const data = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const blob = bytes.subarray(4 + length);
  // Numbers of a few bytes: the lowest bytes of all come first.
  const planes = ([start, end], count) => {
    const size = (end - start) / count;
    return Uint32Array.from({ length: size }, (_, k) => {
      let number = 0;
      for (let plane = count - 1; plane >= 0; plane--) number = number * 256 + blob[start + plane * size + k];
      return number;
    });
  };
  const floats = ([start, end]) => new Float64Array(blob.slice(start, end).buffer);
  for (const scene of data.scenes) {
    const { side } = data;
    if (scene.levels) {
      scene.reference = Float64Array.from(planes(scene.levels, 3), (level) => level / data.levels);
    } else {
      const [columns, rows] = [floats(scene.columns), floats(scene.rows)];
      scene.reference = new Float64Array(side * side);
      for (let k = 0; k < columns.length; k++) {
        const first = k - (k % side);
        for (let x = 0; x < side; x++) scene.reference[(k % side) * side + x] += columns[k] * rows[first + x];
      }
    }
  }
  data.tables = (place) => planes(place, 4);
  return data;
};

// A sampler with a number of samples and a key: what a shader needs, or in words why there is none.
const programOf = (data, sampler, scene, spp, key) => {
  const named = (list, id) => list.find((each) => each.id === id);
  const [made, world] = [named(data.samplers, sampler), named(data.scenes, scene)];
  if (made.dims < world.needs) return `it has ${made.dims} dimensions, the scene needs ${world.needs}`;
  const programs = made.programs[data.counts.indexOf(spp)];
  if (typeof programs === "string") return `not at ${spp} spp: ${programs}`;
  const [text, tables, seeds] = programs[data.keys.indexOf(key)];
  return { name: `${text} ${scene}`, source: data.texts[text], scene: world, dims: made.dims, seeds,
    tables: tables && data.tables(tables) };
};
