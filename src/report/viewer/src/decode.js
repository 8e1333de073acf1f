// The arrays of the page: base64 of deflated bytes, as packed by `page/pack.rs`.

/** The bytes of the array of this name. */
export async function bytes(name) {
  const text = document.getElementById(name).textContent.trim();
  const raw = atob(text);
  const packed = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) packed[i] = raw.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers of seven bits a byte. */
export function varints(data) {
  const numbers = new Uint32Array(data.length);
  let count = 0;
  for (let i = 0; i < data.length; ) {
    let number = 0;
    let shift = 0;
    let byte;
    do {
      byte = data[i++];
      number |= (byte & 127) << shift;
      shift += 7;
    } while (byte & 128);
    numbers[count++] = number >>> 0;
  }
  return numbers.subarray(0, count);
}

/** Coordinates, three a vertex, relative to `centre`. */
export function positions(data, grid, count, centre) {
  const result = new Float32Array(3 * count);
  for (let axis = 0; axis < 3; axis++) {
    const low = 2 * axis * count;
    const high = low + count;
    const offset = grid.origin[axis] - centre[axis];
    let at = 0;
    for (let i = 0; i < count; i++) {
      const zigzag = data[low + i] | (data[high + i] << 8);
      at = (at + ((zigzag >>> 1) ^ -(zigzag & 1))) & 0xffff;
      result[3 * i + axis] = offset + at * grid.step;
    }
  }
  return result;
}

/** Corners numbered by how far each lies below the next new number. */
export function corners(data) {
  const numbers = varints(data);
  let next = 0;
  for (let i = 0; i < numbers.length; i++) {
    numbers[i] = next - numbers[i];
    if (numbers[i] === next) next++;
  }
  return numbers;
}

/** Pairs in rising order of the first, as one flat array. */
export function pairs(data) {
  const numbers = varints(data);
  let before = 0;
  for (let i = 0; i < numbers.length; i += 2) {
    numbers[i] += before;
    before = numbers[i];
    numbers[i + 1] += before;
  }
  return numbers;
}

/** The value of each element of a column; NaN where undefined. */
export async function values(column) {
  const data = await bytes(column.codes);
  if (column.ramp === "names") return Float32Array.from(varints(data));
  const levels = Float32Array.from(column.levels);
  return Float32Array.from(data, (code) => (code < levels.length ? levels[code] : NaN));
}
