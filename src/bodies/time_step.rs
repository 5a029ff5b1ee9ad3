//! The longest stable sub-step: `min 2/ω (√(1+ζ²) − ζ)` over clusters, bonds and contacts.
//!
//! ω² ≤ 2 max λ(M⁻¹K) over single clusters, each with all its springs held at their other ends: rotation
//! is in it, the 2 is for the other ends' motion. Springs are the bonds as stiff as at first, and the
//! contacts of all spheres of that side of the cluster which has most to say.

use super::cluster::frequency;
use super::cohesion::Joints;
use super::contact::World;

/// The limit [s]; infinite if nothing is free.
pub fn longest_stable(world: &World, joints: &Joints) -> f64 {
    let n = world.clusters.len();
    let mut springs: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (j, joint) in (0..).zip(&joints.joints) {
        springs[joint.a as usize].push(j);
        springs[joint.b as usize].push(j);
    }
    // Clusters of one form, density and material ring alike.
    let mut known: Vec<(*const super::Form, f64, u32, f64)> = Vec::new();
    let mut longest = f64::INFINITY;
    for (c, cluster) in world.clusters.iter().enumerate().filter(|(_, c)| c.is_free()) {
        let (stiffness, zeta) = world.materials.stiffest(cluster.material);
        let form: *const super::Form = &*cluster.form;
        let same = |k: &&(*const super::Form, f64, u32, f64)| {
            k.0 == form && k.1 == cluster.mass && k.2 == cluster.material
        };
        let contact = match known.iter().rev().find(same) {
            Some(k) => k.3,
            None => {
                let lambda = cluster.contact_frequency(stiffness);
                known.push((form, cluster.mass, cluster.material, lambda));
                lambda
            }
        };
        let points = springs[c].iter().flat_map(|&j| {
            let joint = &joints.joints[j as usize];
            let side = usize::from(joint.b as usize == c);
            let k = joints.laws[joint.law as usize].stiffness();
            (joint.first as usize..joint.end as usize)
                .map(move |p| (joints.places[p][side], k * joints.area[p]))
        });
        let bonds = frequency(cluster.mass, cluster.moments, points);
        let omega = (2.0 * (contact + bonds)).sqrt();
        let beta = springs[c].iter().map(|&j| joints.damping_time(j)).fold(0.0, f64::max);
        let zeta = zeta.max(0.5 * beta * omega);
        longest = longest.min(2.0 / omega * ((1.0 + zeta * zeta).sqrt() - zeta));
    }
    longest
}
