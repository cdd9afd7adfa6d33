// One atomic addition a fragment.

fn hand_out(kept: bool) -> u32 {
    if !kept {
        return 0xffffffffu;
    }
    return take(1u);
}
