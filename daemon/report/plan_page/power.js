// Power computes the power of the rails from the rows' powers, as steps: watts[k] holds from
// time_s[k] on. Powers are summed in whole nanowatts as Estimate does, so every curve ends at
// exactly 0.

class StepCurve {
  constructor(events) {
    events.sort((a, b) => a.t_s - b.t_s);
    const time_s = [];
    const watts = [];
    let sum_nW = 0;
    for (const {t_s, nW} of events) {
      sum_nW += nW;
      if (time_s[time_s.length - 1] === t_s) watts[watts.length - 1] = sum_nW / 1e9;
      else {
        time_s.push(t_s);
        watts.push(sum_nW / 1e9);
      }
    }
    this.time_s = Float64Array.from(time_s);
    this.watts = Float64Array.from(watts);
    this.peak_W = this.watts.reduce((peak, w) => Math.max(peak, w), 0);
  }

  at(t_s) {
    const k = upperBound(this.time_s, t_s);
    return k === 0 ? 0 : this.watts[k - 1];
  }

  energy_J() {
    let energy = 0;
    for (let k = 0; k + 1 < this.time_s.length; ++k) {
      energy += this.watts[k] * (this.time_s[k + 1] - this.time_s[k]);
    }
    return energy;
  }
}

class Power {
  constructor(motion, rail_limits) {
    const ofRail = new Map();
    const all = [];
    for (let u = 0; u < motion.count; ++u) {
      const rail = motion.units.rail[u];
      if (!ofRail.has(rail)) ofRail.set(rail, []);
      const mine = ofRail.get(rail);
      for (let k = motion.rowBegin[2 * u]; k < motion.rowBegin[2 * u + 2]; ++k) {
        const nW = Math.round(motion.rows.power_W[k] * 1e9);
        const pair = [{t_s: motion.rows.t0_s[k], nW}, {t_s: motion.rows.t1_s[k], nW: -nW}];
        mine.push(...pair);
        all.push(...pair);
      }
    }
    const limits = new Map(rail_limits.map(({rail, limit_W}) => [rail, limit_W]));
    this.total = new StepCurve(all);
    this.rails = [...ofRail.keys()].sort((a, b) => a - b).map((rail) => (
      {rail, curve: new StepCurve(ofRail.get(rail)), limit_W: limits.get(rail)}));
  }
}
