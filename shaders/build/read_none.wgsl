// The count keeps no node, so that there is none to read.

const nodes = array<u32, 1>(0u);
