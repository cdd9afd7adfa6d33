// Without subgroups.

fn sum_before(value: u32, local: u32) -> u32 {
    return sum_in_steps(value, local);
}
