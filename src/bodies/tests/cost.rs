//! What is looked at in a sub-step is what is close, not what is there.

use super::*;

/// `n` × `n` × 4 blocks of 0.2 m, `gap` apart; `sphere`: radius of their contact spheres.
fn stack(n: u32, gap: f64, sphere: f64) -> Bodies {
    let mut scene = Scene::new(contact(1e7, 0.5, 30.0), [0.0, 0.0, -9.81]).floor();
    let form = Scene::form(&Shape::cuboid([0.2, 0.2, 0.2]), sphere);
    for i in 0..n * n * 4 {
        let x = [i / 4 % n, i / 4 / n, i % 4].map(|k| (0.2 + gap) * f64::from(k));
        scene.add(&form, 2000.0, [x[0], x[1], x[2] + 0.1 + 0.5 * gap]);
    }
    scene.start()
}

#[test]
fn cost_is_proportional_to_contacts() {
    // Apart, thousands of spheres cost nothing.
    assert_eq!(stack(10, 0.1, 0.025).candidates(), 0);
    // Side by side, a few blocks or many, the four spheres of each face in common have one partner each.
    for n in [5, 20] {
        let faces = 4 * n * n + 2 * 4 * n * (n - 1);
        assert_eq!(stack(n, 1e-4, 0.05).candidates(), 4 * faces as usize);
    }
}
