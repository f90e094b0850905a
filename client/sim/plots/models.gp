# Mark, colour and name of each axial model, in the order of kAxialModelNames; the first is model 0 of a table.
# Colours of Okabe and Ito (2008), told apart by the colour-blind; marks differ too.
array model_point = [7, 6, 9, 5, 11, 13, 2, 8, 4, 15, 12]
array model_colour = ['#0072B2', '#56B4E9', '#D55E00', '#CC79A7', '#E69F00', '#009E73', '#000000', '#7A5195', '#8C564B', '#666600', '#A6761D']
array model_name = ['Enhanced tracking wall', 'Tracking wall', 'Direct', 'Voigt', 'God object', 'First order', 'Statistical', 'Precomputed', 'FEM', 'Okamura', 'Dahl']
voigt = 3
