//! Arrays in NumPy's format.

use npyz::{AutoSerialize, Order, Serialize, WriteOptions, WriterBuilder};

/// Returns a `.npy` file of an array.
pub fn npy<T: AutoSerialize + Serialize>(shape: &[u64], order: Order, numbers: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = WriteOptions::new().default_dtype().shape(shape).order(order);
    let mut array = options.writer(&mut bytes).begin_nd().unwrap();
    numbers.iter().for_each(|number| array.push(number).unwrap());
    array.finish().unwrap();
    bytes
}
