"""What is run and edited from a checkout: trainings, the tables, proofs. The learners lie in chmarl_pb.learning."""

from chmarl_pb.extras import check

check("training", "train", "torch")
