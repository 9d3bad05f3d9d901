use super::*;
#[test]
fn rooms() {
    for name in NAMES { match Scene::load(name) { Ok(s) => eprintln!("{name} {} places", s.places.len()), Err(e) => eprintln!("{e}") } }
}
