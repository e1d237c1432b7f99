//! Files by other programs.

/// Bytes as NumPy writes them: `data` in the given order, little-endian, of the given type.
pub fn foreign(dtype: &str, fortran: bool, shape: &str, data: &[&[u8]]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let text = format!("{{'descr': '{dtype}', 'fortran_order': {order}, 'shape': {shape}, }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{text:<117}\n").as_bytes());
    bytes.extend(data.concat());
    bytes
}

pub fn doubles(shape: &str, values: &[f64]) -> Vec<u8> {
    let data: Vec<[u8; 8]> = values.iter().map(|v| v.to_le_bytes()).collect();
    let data: Vec<&[u8]> = data.iter().map(|v| &v[..]).collect();
    foreign("<f8", false, shape, &data)
}
