//! Regularisation in ψ form (METHOD.md, 2): k explicit conservative sub-steps after transport,
//!
//! ```text
//!     m_i Δφ_i = −(Δt/k) Σ_e V_e ∇N_i·s_e r_e,   s_e = Γ w(q) q G,   r = d n̄ + max(−d, 0) (∇ψ_h − (1+d) n̄)
//! ```
//!
//! with `q = min φ(1−φ)` over the element's nodes, `d = ∇ψ_h·n̄ − 1` and the gate `G = d²/(d²+0.03²)`. A flat
//! profile of width δ, at any slope, has ∇ψ_h = n̄ in every element: nothing moves, to round-off.
//!
//! With the element's own normal, `r = ∇ψ_h − n_e`, the part across n_e is `(1 − 1/|∇ψ|)` times the
//! change of ∇ψ: where the profile is thicker than δ, |∇ψ| < 1, that is diffusion of the wrong sign, fastest at
//! the grid scale, and a profile 1.5 δ thick breaks up into lumps. Here n̄ is averaged over the elements around
//! the element's nodes, r acts along it, and across it only with diffusion of the right sign.
//!
//! **Ripples.** A surface with d = 0 may still be rough: gravity alone levels it, by waves that swing for ever where
//! there is no viscosity, down to two cells in length. To s r is therefore added `½ √(g h/π) w(q) q` times what the
//! slope across n̄ differs by from its mean over the elements around: √(g h/π) is the speed of the shortest waves of
//! the mesh, half of it times δ the viscosity of upwinding, and it acts on what the mesh does not resolve alone (a
//! local projection). What waves lose in a period falls with the fourth power of their number of cells.
//!
//! Explicit limit: since dψ/dφ = δ/(φ(1−φ)) and q is the smallest φ(1−φ), the linearised diffusivity is at
//! most Γδ, and the largest eigenvalue of the lumped step at most Γδ λ, λ = 4 λ_max(Σ_i ∇N_i ∇N_iᵀ) of
//! the worst element. n is chosen from it; if 6 are not enough, Γ is reduced in the elements concerned.

use super::Phase;
use super::profile::{OVERSHOOT, smoothstep, window};
use crate::cut::{Cell, CutMesh};
use crate::fem::{dot, norm};
use crate::mesh::tetrahedron::Tetrahedron;
use crate::mesh::{Mesh, MeshPart};
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// Fewest and most sub-steps.
const SUB_STEPS: [u32; 2] = [2, 6];
/// Largest Γδλ Δt/n: 2 is the limit of stability, 1 that of monotone decay.
const LIMIT: f64 = 1.6;
/// Overshoot from which its diffusion is whole.
const WHOLE: f64 = 0.01;
/// Slope error |∇ψ| − 1 at which the gate is half open. Without a gate, waves on 20 cells of depth lose 6 % more
/// in ten periods, with this one 0.3 % more, than with 0.1, which leaves noise on still water half as fast again.
const GATE: f64 = 0.03;

/// |∇ψ| below which an element's normal fades out: of length 1 everywhere, it would be a matter of rounding in
/// elements with one value of ψ at all nodes, as there are at the edges of a column.
const FLAT: f64 = 0.1;
/// Mean normal times ∇ψ/|∇ψ| from which on the mean is trusted alone.
const ALIKE: f64 = 0.1;

/// Speed that ripples are levelled with, over that of the shortest waves.
const UPWIND: f64 = 0.5;

/// λ_e = λ_max(Σ_i r_i ∇N_i ∇N_iᵀ) of every element [1/m²], where r_i is the volume of fluid around node i over
/// its lumped mass, 4 but near structures: a bound for the eigenvalues of `Σ_e V_e ∇N_i·∇N_j / m_i`.
///
/// Found anew where the ratios are no longer those `before`.
pub(super) fn set_stiffness(mesh: &Mesh, before: &[f64], ratio: &[f64], stiffness: &mut [f32]) {
    for (e, tet) in mesh.tets.iter().enumerate() {
        let n = tet.map(|n| n as usize);
        if n.iter().any(|&i| ratio[i] != before[i]) {
            let g = Tetrahedron::of(mesh, e).grad;
            let entry =
                |r: usize, c: usize| (0..4).map(|i| ratio[n[i]] * g[i][r] * g[i][c]).sum::<f64>();
            stiffness[e] = largest_eigenvalue(&Matrix3::from_fn(entry)) as f32;
        }
    }
}

/// Of a symmetric matrix, in closed form: the roots of a cubic with three real ones, as a cosine.
fn largest_eigenvalue(m: &Matrix3<f64>) -> f64 {
    let mean = m.trace() / 3.0;
    let rest = m - Matrix3::from_diagonal_element(mean);
    let size = (rest.norm_squared() / 6.0).sqrt();
    if size <= f64::EPSILON * mean.abs() {
        return mean;
    }
    let cosine = 0.5 * (rest / size).determinant();
    mean + 2.0 * size * (cosine.clamp(-1.0, 1.0).acos() / 3.0).cos()
}

/// `phase.phi` regularised over Δt with Γ = `speed`; returns the number of sub-steps. Collective.
pub(super) fn sub_steps(
    phase: &mut Phase,
    part: &MeshPart,
    cut: &CutMesh,
    dt: f64,
    speed: f64,
) -> u32 {
    phase.profile.set(&phase.phi, false);
    let mut stiffest = 0.0f32;
    for (e, tet) in part.assembled().iter().enumerate() {
        // Few nodes have most of their support in a structure: Γ yields there, not the number of steps.
        if matches!(cut.cell(e), Cell::Whole) && phase.profile.in_band(tet).is_some() {
            stiffest = stiffest.max(phase.stiffness[e]);
        }
    }
    let waves = UPWIND * phase.mobility * (phase.gravity * phase.cell / PI).sqrt();
    let worst = (speed + waves) * phase.delta * part.max(f64::from(stiffest)) * dt;
    if worst == 0.0 {
        return 0;
    }
    let n = ((worst / LIMIT).ceil() as u32).clamp(SUB_STEPS[0], SUB_STEPS[1]);
    set_slopes(phase, part, cut);
    for sub in 0..n {
        if sub > 0 {
            phase.profile.set(&phase.phi, false);
        }
        sub_step(phase, part, cut, dt, n, [speed, waves]);
        part.exchange.update_ghosts(&mut phase.phi);
    }
    n
}

/// One of `n`.
fn sub_step(
    phase: &mut Phase,
    part: &MeshPart,
    cut: &CutMesh,
    dt: f64,
    n: u32,
    [speed, waves]: [f64; 2],
) {
    let share = 1.0 / f64::from(n);
    let dt = dt * share;
    let n_owned = part.n_owned();
    let most = LIMIT / (phase.delta * dt);
    for (e, tet) in part.assembled().iter().enumerate() {
        let Some(nodes) = phase.profile.in_band(tet) else {
            if phase.profile.overshoots(tet) {
                let speed = speed.min(most / f64::from(phase.stiffness[e]));
                diffuse_overshoot(phase, part, cut, e, dt, speed);
            }
            continue;
        };
        let t = Tetrahedron::of(&part.mesh, e);
        let slope = t.gradient(nodes.map(|n| phase.delta * n.s));
        // The mean of n_e around the element, and how much steeper than around it the element is.
        let (mut around, mut volume, mut ripple) = ([0.0; 3], 0.0, slope);
        for i in tet.map(|i| i as usize) {
            volume += phase.normal[i][3];
            for k in 0..3 {
                around[k] += phase.normal[i][k];
                ripple[k] -= 0.25 * phase.slope[i][k];
            }
        }
        let around = around.map(|n| n / volume.max(f64::MIN_POSITIVE));
        let q = nodes[0].q.min(nodes[1].q).min(nodes[2].q.min(nodes[3].q));
        let most = most / f64::from(phase.stiffness[e]);
        let speed = speed.min(most);
        let waves = waves.min(most - speed);
        let along = |n: [f64; 3]| {
            let d = dot(n, slope) - 1.0;
            let c = (-d).clamp(0.0, 1.0);
            let s = speed * (d * d / (d * d + GATE * GATE));
            let aside = dot(n, ripple);
            let across = |k: usize| ripple[k] - aside * n[k];
            let r = |k: usize| d * n[k] + c * (slope[k] - (1.0 + d) * n[k]);
            [0, 1, 2].map(|k| window(q) * q * (s * r(k) + waves * across(k)))
        };
        // Across a sheet thinner than two elements the average means nothing: there, the element's own.
        let trust = smoothstep(dot(around, slope) / (ALIKE * norm(slope).max(FLAT)));
        let mut flux = [0.0; 3];
        for (n, share) in [(normal(slope), 1.0 - trust), (around.map(|c| c / norm(around)), trust)]
        {
            if share > 0.0 {
                let along = along(n);
                (0..3).for_each(|k| flux[k] += share * along[k]);
            }
        }
        let volume = dt * cut.fluid_volume(&part.mesh, e);
        for k in 0..3 {
            phase.flux[e][k] += share * flux[k];
        }
        for i in 0..4 {
            let at = tet[i] as usize;
            if at < n_owned {
                add_liquid(phase, at, -volume * dot(t.grad[i], flux));
            }
        }
    }
}

/// Liquid [m³] for node `i`.
#[inline]
fn add_liquid(phase: &mut Phase, i: usize, volume: f64) {
    if phase.margin.contains(i) {
        phase.margin.parked[i] += volume;
    } else {
        phase.phi[i] += volume * phase.inverse_lumped[i];
    }
}

/// ∇ψ_h/|∇ψ_h|, faded out where that is rounding.
#[inline]
fn normal(slope: [f64; 3]) -> [f64; 3] {
    let size = norm(slope);
    let share = smoothstep(size / FLAT) / size.max(f64::MIN_POSITIVE);
    slope.map(|c| c * share)
}

/// Around each node: Σ_e V_e n_e and Σ_e V_e, and the mean of ∇ψ_h.
fn set_slopes(phase: &mut Phase, part: &MeshPart, cut: &CutMesh) {
    phase.normal.fill([0.0; 4]);
    phase.slope.fill([0.0; 3]);
    for (e, tet) in part.assembled().iter().enumerate() {
        let Some(nodes) = phase.profile.in_band(tet) else { continue };
        let t = Tetrahedron::of(&part.mesh, e);
        let volume = cut.fluid_volume(&part.mesh, e);
        let slope = t.gradient(nodes.map(|n| phase.delta * n.s));
        let n = normal(slope);
        for i in tet.map(|i| i as usize) {
            phase.normal[i][3] += volume;
            for k in 0..3 {
                phase.normal[i][k] += volume * n[k];
                phase.slope[i][k] += volume * slope[k];
            }
        }
    }
    for (slope, normal) in phase.slope.iter_mut().zip(&phase.normal) {
        *slope = slope.map(|s| s / normal[3].max(f64::MIN_POSITIVE));
    }
    part.exchange.update_ghosts(&mut phase.normal);
    part.exchange.update_ghosts(&mut phase.slope);
}

/// `m_i Δφ_i −= Δt Γδ v(o) ∫ ∇N_i·∇φ_h` where φ leaves [0, 1] by o.
fn diffuse_overshoot(
    phase: &mut Phase,
    part: &MeshPart,
    cut: &CutMesh,
    e: usize,
    dt: f64,
    speed: f64,
) {
    let tet = &part.mesh.tets[e];
    let nodes = tet.map(|n| &phase.profile.nodes[n as usize]);
    let least = nodes[0].q.min(nodes[1].q).min(nodes[2].q.min(nodes[3].q));
    let v = smoothstep((-least - OVERSHOOT) * (1.0 / (WHOLE - OVERSHOOT)));
    let t = Tetrahedron::of(&part.mesh, e);
    let grad = t.gradient(nodes.map(|n| n.phi));
    let flux = dt * cut.fluid_volume(&part.mesh, e) * speed * phase.delta * v;
    for i in 0..4 {
        let at = tet[i] as usize;
        if at < part.n_owned() {
            add_liquid(phase, at, -flux * dot(t.grad[i], grad));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{SETTINGS, cube, of_distance};
    use super::*;
    use crate::phase::profile::sigmoid;

    #[test]
    fn the_largest_eigenvalue_is_nalgebras() {
        let turned = |d: [f64; 3]| {
            let r = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 0.7).into_inner();
            r * Matrix3::from_diagonal(&d.into()) * r.transpose()
        };
        for d in [[1.0, 2.0, 3.0], [5.0, 5.0, 1.0], [5.0, 1.0, 1.0], [2.0; 3], [0.0; 3]] {
            let m = turned(d);
            let exact = m.symmetric_eigenvalues().max();
            assert!((largest_eigenvalue(&m) - exact).abs() < 1e-7 * exact.max(1.0), "{d:?}");
        }
    }

    /// Smallest and largest ∇ψ·ẑ, and largest slope aside, where φ(1−φ) > 0.05, after sub-steps from a flat
    /// profile of `start` times δ.
    fn relaxed(start: f64, steps: usize) -> [f64; 3] {
        let part = cube(12);
        let settings = crate::case::FreeSurface { thickness: Some(0.09), ..SETTINGS };
        let mut phase = of_distance(&part, &settings, 1e-6, |x| x[2] - 0.47);
        for (phi, x) in phase.phi.iter_mut().zip(&part.mesh.nodes) {
            *phi = sigmoid((x[2] - 0.47) / (start * phase.delta));
        }
        let total = |phase: &Phase| -> f64 {
            phase.phi.iter().zip(&phase.lumped).map(|(f, m)| f * m).sum()
        };
        let before = total(&phase);
        for _ in 0..steps {
            sub_steps(&mut phase, &part, &CutMesh::whole(), 0.05, 1.0);
        }
        assert!((total(&phase) / before - 1.0).abs() < 1e-13, "the sub-steps conserve ∫φ_h");
        phase.profile.set(&phase.phi, false);
        let mut seen = [f64::MAX, 0.0f64, 0.0f64];
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let nodes = tet.map(|n| phase.profile.nodes[n as usize]);
            if nodes.iter().all(|n| n.q > 0.05) {
                let g = Tetrahedron::of(&part.mesh, e).gradient(nodes.map(|n| phase.delta * n.s));
                seen = [seen[0].min(g[2]), seen[1].max(g[2]), seen[2].max(g[0].hypot(g[1]))];
            }
        }
        seen
    }

    #[test]
    fn a_profile_of_any_thickness_relaxes_to_the_tanh_without_breaking_up() {
        for start in [0.6, 1.5, 2.0] {
            let [least, most, aside] = relaxed(start, 0);
            assert!((least * start - 1.0).abs() < 1e-10 && (most * start - 1.0).abs() < 1e-10);
            assert!(aside < 1e-10);
            // The gate leaves slope errors of a few per cent alone.
            let [least, most, aside] = relaxed(start, 60);
            assert!(least > 0.93 && most < 1.07 && aside < 0.08, "{start}: {least} {most} {aside}");
        }
    }

    /// `flux` is what moved φ: the momentum that goes with it would else be another.
    #[test]
    fn the_flux_that_is_handed_on_is_the_one_that_moved() {
        let part = cube(6);
        let mut phase = of_distance(&part, &SETTINGS, 1e-6, |x| {
            1.7 * (0.3 - crate::fem::norm([x[0] - 0.5, x[1] - 0.4, x[2] - 0.5]))
        });
        let (before, dt) = (phase.phi.clone(), 0.02);
        assert!(sub_steps(&mut phase, &part, &CutMesh::whole(), dt, 1.0) > 1);
        let mut expected = before.clone();
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let t = Tetrahedron::of(&part.mesh, e);
            for i in 0..4 {
                let n = tet[i] as usize;
                expected[n] -= dt * t.volume * dot(t.grad[i], phase.flux[e]) / phase.lumped[n];
            }
        }
        let most =
            |a: &[f64]| a.iter().zip(&phase.phi).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most(&before) > 1e-3 && most(&expected) < 1e-14, "{}", most(&expected));
    }

    #[test]
    fn the_step_is_stable_beyond_its_limit_and_overshoots_decay() {
        let part = cube(8);
        let mut phase = of_distance(&part, &SETTINGS, 1e-6, |x| {
            0.3 - crate::fem::norm([x[0] - 0.5, x[1] - 0.5, x[2] - 0.5])
        });
        // A splash thinner than the mesh, and an undershoot.
        phase.phi[100] = 0.9;
        phase.phi[300] = -0.1;
        for _ in 0..50 {
            assert_eq!(sub_steps(&mut phase, &part, &CutMesh::whole(), 1.0, 1.0), SUB_STEPS[1]);
        }
        assert!(phase.phi.iter().all(|p| (-0.011..1.011).contains(p)));
    }

    /// What is left of the first of cos(2πx/λ) in the height of a flat profile after a time t √(g/h) = 12.
    fn left_of_wave(cells: f64) -> f64 {
        let part = cube(12);
        let k = 2.0 * PI * 12.0 / cells;
        let mut phase =
            of_distance(&part, &SETTINGS, 1e-6, |x| x[2] - 0.47 + 0.01 * (k * x[0]).cos());
        phase.feel(9.81);
        let height = |phase: &Phase| -> f64 {
            (phase.phi.iter().zip(&phase.lumped).zip(&part.mesh.nodes))
                .map(|((f, m), x)| f * m * (k * x[0]).cos())
                .sum()
        };
        let before = height(&phase);
        let dt = 0.1 * (1.0f64 / (12.0 * 9.81)).sqrt();
        for _ in 0..120 {
            sub_steps(&mut phase, &part, &CutMesh::whole(), dt, 0.0);
        }
        height(&phase) / before
    }

    #[test]
    fn gravity_levels_ripples_of_the_mesh_and_leaves_waves_alone() {
        // A viscosity would take from the wave a ninth of what it takes from the ripple.
        let (ripple, wave) = (left_of_wave(4.0), left_of_wave(12.0));
        assert!(ripple < 0.4 && wave.ln() > ripple.ln() / 27.0, "{ripple} {wave}");
    }
}
