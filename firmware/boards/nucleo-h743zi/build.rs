//! Puts the link map of the default board, at the top of the repository, where the linker looks.

fn main() {
    const MAP: &str = "../../../memory.x";
    let out = std::path::PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    std::fs::copy(MAP, out.join("memory.x")).expect("the link map is at the top of the repository");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed={MAP}");
}
