#include "measurement/column.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace bms::measurement {
namespace {

TEST(Column, CopiesAndPartsViewTheSameValues) {
  const Column whole({1, 2, 3, 4});
  const Column copy = whole, part = whole.part(1, 2);
  EXPECT_EQ(copy.data(), whole.data());
  EXPECT_EQ(part.data(), whole.data() + 1);
  EXPECT_EQ(part.copy(), (std::vector<double>{2, 3}));
  EXPECT_EQ(part.front(), 2);
  EXPECT_EQ(part.back(), 3);
}

TEST(Column, AnEditChangesNoOtherColumn) {
  const Column read({1, 2, 3});
  Column changed = read;
  changed.edit()[1] = 7;
  EXPECT_EQ(changed.copy(), (std::vector<double>{1, 7, 3}));
  EXPECT_EQ(read.copy(), (std::vector<double>{1, 2, 3}));
}

TEST(Column, AnEditedPartHasOnlyItsOwnRows) {
  const Column read({1, 2, 3, 4});
  Column part = read.part(2, 2);
  part.edit().push_back(5);
  EXPECT_EQ(part.copy(), (std::vector<double>{3, 4, 5}));
  EXPECT_EQ(read.size(), 4u);
}

TEST(Column, AnEditOfAColumnThatNothingSharesCopiesNothing) {
  Column own({1, 2, 3});
  const double* before = own.data();
  own.edit()[0] = 5;
  EXPECT_EQ(own.data(), before);
  EXPECT_EQ(own[0], 5);
}

TEST(Column, EmptyColumnsAreIndependentOfEachOther) {
  Column one;
  const Column other;
  EXPECT_TRUE(one.empty());
  EXPECT_TRUE(one.part(3, 2).empty());
  one.edit().push_back(1);
  EXPECT_EQ(one.size(), 1u);
  EXPECT_TRUE(other.empty());
}

TEST(Column, APartEndsWithTheColumn) {
  const Column whole({1, 2, 3});
  EXPECT_EQ(whole.part(2, 9).size(), 1u);
  EXPECT_EQ(whole.part(1, 2).part(1, 9).copy(), (std::vector<double>{3}));
}

TEST(Column, APartOutlivesTheColumnThatItWasTakenFrom) {
  const Column part = Column({1, 2, 3}).part(1, 1);
  EXPECT_EQ(part.copy(), (std::vector<double>{2}));
}

}  // namespace
}  // namespace bms::measurement
