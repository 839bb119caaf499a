// Raster draws lines and dots into the pixels of an image, without the browser's own lines: a path
// of 20,000 pieces takes ten times as long where there is no graphics card. Colours are 32-bit
// numbers as an ImageData has them, 0xAABBGGRR.

export class Raster {
  constructor() {
    this.width = 0;
    this.height = 0;
    this.top = 0;  // rows outside are left as they are
    this.bottom = 0;
  }

  resize(width, height) {
    if (this.width === width && this.height === height) return;
    this.width = width;
    this.height = height;
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /** Draws into the rows `top` .. `bottom` - 1 alone. */
  clip(top, bottom) {
    this.top = Math.max(0, top);
    this.bottom = Math.min(this.height, bottom);
  }

  clear(colour) {
    this.pixels.fill(colour, this.top * this.width, this.bottom * this.width);
  }

  /** Covers a pixel by a share of 0 to 256. */
  cover(at, colour, share) {
    if (share >= 256) {
      this.pixels[at] = colour;
      return;
    }
    const below = this.pixels[at];
    const rest = 256 - share;
    const redBlue = (((below & 0xFF00FF) * rest + (colour & 0xFF00FF) * share) >>> 8) & 0xFF00FF;
    const green = (((below & 0x00FF00) * rest + (colour & 0x00FF00) * share) >>> 8) & 0x00FF00;
    this.pixels[at] = (0xFF000000 | redBlue | green) >>> 0;
  }

  /** A line with soft edges. Units: device pixels; `wide` is the width across the line. */
  line(x0, y0, x1, y1, wide, colour) {
    const dx = x1 - x0;
    const dy = y1 - y0;
    const steep = Math.abs(dy) > Math.abs(dx);
    const length = steep ? Math.abs(dy) : Math.abs(dx);
    if (length < 1e-6) return;
    // Across a slanted line a pixel is longer than the line is wide.
    const half = wide * Math.hypot(dx, dy) / length / 2;
    const forward = steep ? dy > 0 : dx > 0;
    const begin = steep ? (forward ? y0 : y1) : (forward ? x0 : x1);
    const end = steep ? (forward ? y1 : y0) : (forward ? x1 : x0);
    const across0 = steep ? (forward ? x0 : x1) : (forward ? y0 : y1);
    const across1 = steep ? (forward ? x1 : x0) : (forward ? y1 : y0);
    const slope = (across1 - across0) / (end - begin);
    const limit = steep ? this.bottom : this.width;
    const limitAcross = steep ? this.width : this.bottom;
    const least = steep ? this.top : 0;
    const leastAcross = steep ? 0 : this.top;
    const first = Math.max(least, Math.floor(begin));
    const last = Math.min(limit - 1, Math.floor(end));
    const stride = steep ? 1 : this.width;  // across the line
    const along = steep ? this.width : 1;
    for (let p = first; p <= last; ++p) {
      const ends = Math.min(p + 1, end) - Math.max(p, begin);  // of the line's two ends
      const middle = across0 + (p + 0.5 - begin) * slope;
      const low = middle - half;
      const high = middle + half;
      let q = Math.max(leastAcross, Math.floor(low));
      const stop = Math.min(limitAcross, high);
      for (; q < stop; ++q) {
        const share = Math.min(q + 1, high) - Math.max(q, low);
        this.cover(p * along + q * stride, colour, (256 * share * ends) | 0);
      }
    }
  }

  /** A filled square about a point. */
  dot(x, y, half, colour) {
    const left = Math.max(0, Math.round(x - half));
    const right = Math.min(this.width, Math.round(x + half));
    const top = Math.max(this.top, Math.round(y - half));
    const bottom = Math.min(this.bottom, Math.round(y + half));
    for (let row = top; row < bottom; ++row)
      for (let column = left; column < right; ++column)
        this.pixels[row * this.width + column] = colour;
  }
}
