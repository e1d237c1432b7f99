//! Finished parts.

use runs::{Cache, Error};

#[test]
fn parts_are_used_for_the_same_key_only() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path().join("results/partial")).unwrap();
    let (key, result) = (("radius", 0.1 + 0.2, 0.1_f32), vec![1.0 / 3.0, 1e-17]);
    assert_eq!(cache.load::<Vec<f64>>("a", &key), None);
    cache.store("a", &key, &result).unwrap();
    assert_eq!(cache.load("a", &key), Some(result));
    assert_eq!(cache.load::<Vec<f64>>("a", &("radius", 0.3, 0.1_f32)), None);
    assert_eq!(cache.load::<String>("a", &key), None);
    let path = root.path().join("results/partial/a.json");
    std::fs::write(path, "[[\"radius\", ").unwrap();
    assert_eq!(cache.load::<Vec<f64>>("a", &key), None);
    for name in ["../a", "b/a", ""] {
        let refused = cache.store(name, &key, &1);
        assert!(matches!(refused, Err(Error::Invalid(_))), "{name}");
    }
    cache.remove().unwrap();
    assert!(!root.path().join("results/partial").exists());
}
