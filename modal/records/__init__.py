"""Results of finite elements as they are saved, read and shown: nothing here needs the solvers that make them."""
